"""What a process does in which cells are solved, done in this one."""

import math
import resource
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from running import tall

from sweep.runs import isolated

STUDY = tall(10)


@pytest.fixture(autouse=True)
def here(monkeypatch):
    """What is loaded is forgotten."""
    monkeypatch.setattr(isolated, "_here", {})
    clock = SimpleNamespace(now=0.0, watched=0)
    monkeypatch.setattr(isolated, "work_clock", Clock(clock))
    return clock


class Clock:
    """Shows what a test sets."""

    def __init__(self, hand):
        self.hand, self.flag = hand, None

    def __call__(self):
        return self.hand.now

    def watch(self):
        self.hand.watched += 1


def fall(*heights):
    return pytest.approx([math.sqrt(2 * h / 9.80665) for h in heights], rel=1e-12)


def test_cells_are_answered_with_their_seconds_and_memory(here, monkeypatch):
    isolated.load(STUDY.to_json(), (), None)
    assert here.watched == 1
    solver = isolated._here["solver"]
    real = solver.solve

    def solve(*words):
        here.now += 2.5
        real(*words)

    monkeypatch.setattr(solver, "solve", solve)
    usage = SimpleNamespace(ru_maxrss=3072)
    monkeypatch.setattr(isolated.resource, "getrusage", lambda who: usage)
    here.now = 10.0
    monkeypatch.setattr(isolated.sys, "platform", "linux")
    answer = isolated.solve(4, 3, None)
    assert answer.arrays["fall_time"] == fall(5, 6, 7)
    assert (answer.reason, answer.seconds, answer.memory) == ("", 2.5, 3072 * 1024)
    monkeypatch.setattr(isolated.sys, "platform", "darwin")
    assert isolated.solve(4, 3, np.array([True, False, True])).memory == 3072


@pytest.mark.parametrize("fault", [ValueError("odd"), KeyboardInterrupt()])
def test_what_a_kernel_raises_is_answered(here, monkeypatch, fault):
    isolated.load(STUDY.to_json(), (), None)

    def solve(*words):
        here.now += 1.5
        raise fault

    monkeypatch.setattr(isolated._here["solver"], "solve", solve)
    answer = isolated.solve(4, 3, None)
    assert (answer.arrays, answer.seconds) == ({}, 1.5)
    assert answer.reason.startswith(type(fault).__name__)


@pytest.mark.parametrize(("good", "solved"), [(None, []), (0, [(0, 1, None)]), (4, [(4, 1, None)])])
def test_a_cell_that_is_known_to_end_is_solved_first(monkeypatch, good, solved):
    asked = []
    monkeypatch.setattr(isolated, "solve", lambda *words: asked.append(words))
    isolated.load(STUDY.to_json(), (), good)
    assert asked == solved


def test_folders_of_kernels_are_looked_in_once(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, "there"])
    before = list(sys.path)
    isolated.load(STUDY.to_json(), ("there", str(tmp_path)), None)
    assert sys.path == [*before, str(tmp_path)]


@pytest.mark.parametrize(("hard", "soft"), [(-1, 1), (0, 0), (1, 1), (5, 1)])
def test_a_core_is_as_short_as_can_be(monkeypatch, hard, soft):
    told = []
    monkeypatch.setattr(isolated.resource, "getrlimit", lambda which: (77, hard))
    monkeypatch.setattr(isolated.resource, "setrlimit", lambda which, limits: told.append((which, limits)))
    isolated._leave_no_core()
    assert told == [(resource.RLIMIT_CORE, (soft, hard))]


@pytest.mark.parametrize("parent", [True, False])
def test_a_process_ends_with_its_parent(monkeypatch, parent):
    told = []
    found = SimpleNamespace(join=lambda: told.append("joined")) if parent else None
    monkeypatch.setattr(isolated.multiprocessing, "parent_process", lambda: found)
    monkeypatch.setattr(isolated.os, "_exit", told.append)
    isolated._die_with_parent()
    assert told == (["joined", 0] if parent else [])
