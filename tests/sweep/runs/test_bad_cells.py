"""Kernels that raise, crash, or never end cost the cells they do so at, and nothing else."""

import io
import resource
import time
from concurrent.futures import ThreadPoolExecutor

import bad
import numpy as np
import pytest
from running import quiet, tall, wait_for
from toy_studies import build

import sweep
from kernels.interface import Status
from sweep.cells.block import Guard
from sweep.cells.schema import empty_cells
from sweep.errors import CELLS_FAILED, MISTAKE, SweepError
from sweep.file.store import unfinished_of
from sweep.results.statuses import account
from sweep.runs import isolate
from sweep.runs.isolate import Processes

SOUND = 100
BAD = {"bad:RAISING": [11.0], "bad:DYING": [11.0, 22.0, 33.0], "bad:WORST": [11.0, 22.0, 33.0, 44.0, 55.0, 66.0]}
KEYS = {"bad:RAISING": {"block_cells": 10}, "bad:DYING": {"isolate": True}}
KEYS["bad:WORST"] = {"cell_timeout": 5.0, "block_cells": 10}  # two that never end are waited for at the same time


def heights_of(found, status):
    return found.height.values[found.status.values == status].tolist()


def good(found):
    return found.isel(height=found.status.values != Status.FAILED)


@pytest.fixture(scope="module")
def whole():
    return quiet(tall(SOUND, "bad:RAISING"), isolate=True)


@pytest.mark.parametrize("name", BAD)
def test_bad_cells_fail_by_name_and_all_others_have_the_bits_of_a_run_without_them(name, whole, tmp_path):
    log = io.StringIO()
    with quiet(tall(SOUND, name), tmp_path / "out.h5", progress=log, **KEYS[name]) as found:
        assert heights_of(found, Status.FAILED) == BAD[name]
        assert np.isnan(found.fall_time.values[found.status.values == Status.FAILED]).all()
        kept = good(found)
        assert kept.fall_time.values.tobytes() == whole.fall_time.sel(height=kept.height).values.tobytes()
        assert account(found).by_kind["FAILED"] == len(BAD[name])
    told = [line.partition("FAILED ")[2] for line in log.getvalue().splitlines() if "FAILED" in line]
    assert sorted(text.partition(":")[0] for text in told) == [f"(height={int(height)})" for height in BAD[name]]
    reasons = {"11": "ZeroDivisionError: eleven", "22": "SIGSEGV", "33": "ended with 7", "44": "longer than 5 s"}
    for height, reason in reasons.items():
        given = [text for text in told if f"height={height})" in text]
        assert float(height) not in BAD[name] or reason in given[0]


def test_a_process_that_died_by_itself_was_not_late(monkeypatch):
    """Although it is found out only when its time is up, as where an image of its memory is written meanwhile."""

    def blind(pipes, seconds, real=isolate.wait):
        """Sees what is answered, but no end."""
        time.sleep(seconds)
        return [pipe for pipe in real(pipes, 0.0) if pipe.poll() and not pipe.closed and not dead(pipe)]

    def dead(pipe):
        return any(process.pipe is pipe and not process.is_alive() for process in processes._all)

    monkeypatch.setattr(isolate, "wait", blind)
    axes = {"height": [1.0, bad.RAISES, bad.CRASHES, bad.EXITS]}
    processes, seen = Processes(build(kernel="bad:DYING", axes=axes), 1.0), []
    Guard(processes, seen.append).solve(0, empty_cells(processes.study, 4))
    processes.end()
    assert [cell.reason for cell in seen] == [
        "ZeroDivisionError: eleven",
        "its process died of SIGSEGV",
        "its process ended with 7",
    ]


def test_a_cell_that_is_stopped_in_its_last_trial_is_not_blamed(monkeypatch):
    monkeypatch.setattr(isolate, "TRIALS", 1)
    processes, seen = Processes(tall(50, "bad:STUCK"), None), []
    solver = Guard(processes, seen.append)
    cell = empty_cells(processes.study, 1)
    solver.solve(0, cell)  # its process is there from now on
    with ThreadPoolExecutor(1) as thread:
        stuck = thread.submit(solver.solve, int(bad.HANGS) - 1, cell)
        time.sleep(0.5)
        processes.end()
        with pytest.raises(SweepError, match="stopped"):
            stuck.result(30)
    assert not seen


def test_a_kernel_that_kills_its_parent_costs_the_cell_and_none_of_those_that_other_processes_are_at():
    found = quiet(tall(96, "bad:ORPHANED"), isolate=True, block_cells=12)
    assert heights_of(found, Status.FAILED) == [bad.ORPHANS]


@pytest.mark.parametrize("isolate", [False, True])
def test_a_kernel_that_ends_python_or_raises_what_cannot_be_told_costs_those_cells(isolate, tmp_path):
    log = io.StringIO()
    with quiet(tall(SOUND, "bad:QUITTING"), tmp_path / "out.h5", isolate=isolate, progress=log) as found:
        assert heights_of(found, Status.FAILED) == [bad.QUITS, bad.MUMBLES]
    assert all(word in log.getvalue() for word in ("SystemExit", "Mumbling"))
    assert "\x1b" not in log.getvalue()
    assert len(log.getvalue()) < 3000


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="the limit of another process is set on Linux only")
def test_where_no_process_can_be_started_the_run_ends_and_no_cell_is_blamed(begun, tmp_path):
    deadly = ("bad:DEADLY", 600, "--workers", "2")
    process, output = begun(*deadly, TMPDIR=str(tmp_path))
    wait_for(unfinished_of(output).exists, process)
    resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (6, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    assert process.wait(60) == MISTAKE
    assert "process" in process.stderr.read()
    long = tmp_path / ("x" * 100)
    long.mkdir()
    process, output = begun(*deadly, TMPDIR=str(long))  # sockets have names of at most 108 characters
    assert process.wait(60) == MISTAKE
    assert "TMPDIR" in process.stderr.read()
    process, output = begun(*deadly)
    assert process.wait(60) == CELLS_FAILED
    with sweep.open_result(output) as found:
        assert heights_of(found, Status.FAILED) == [bad.CRASHES, bad.EXITS]


@pytest.mark.parametrize("isolate", [False, True])
def test_a_kernel_of_which_every_cell_is_bad_is_told_at_once(isolate):
    with pytest.raises(SweepError, match=r"bad:HOPELESS: .*ZeroDivisionError"):
        quiet(tall(50, "bad:HOPELESS"), isolate=isolate)


def test_what_compiling_takes_is_not_taken_for_what_a_cell_takes():
    found = quiet(tall(20, "bad:LATE"), workers=1, cell_timeout=0.3)
    assert account(found).by_kind["ok"] == 20
