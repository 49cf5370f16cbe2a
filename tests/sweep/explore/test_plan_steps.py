"""A plan's texts and sums, word for word; no cell is computed."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from toy_studies import build

from kernels.interface import Status
from sweep.cells.partition import RowBlocks
from sweep.cells.timing import Sample
from sweep.explore import plan as module
from sweep.explore.plan import Plan, small_duration


def made(**changed):
    keys = {"title": "", "kernel": "toy:KERNEL", "cells": 12_000, "shape": {"a": 4000, "b": 3}, "outputs": ("x", "y")}
    keys |= {"blocks": 1200, "cells_per_block": 1000, "workers": 2, "output_bytes": 5000, "memory_bytes": 6000}
    keys |= {"free_bytes": 5000, "folder": "/here", "cell_seconds": 2e-5, "seconds": 75.0}
    return Plan(**keys | changed)


def test_a_disk_or_memory_that_just_suffices_is_no_warning(monkeypatch):
    monkeypatch.setattr(module, "memory", lambda: 6000)
    assert made().warnings == []
    found = made(output_bytes=5001, memory_bytes=6001)
    assert found.warnings == [
        "the disk is too small: 5 kB needed, 5 kB free in /here",
        "the memory is too small: 6 kB needed, 6 kB there",
    ]
    assert "the memory is too small" in str(found)


@pytest.mark.parametrize(
    ("folder", "kernel", "when"),
    [
        ("/code", "foliot", "just now; the machine code is kept"),
        ("/code", "toy:KERNEL", "of it, before the first cell"),
        (None, "foliot", "of it, before the first cell"),
    ],
)
def test_what_compiling_took_and_whether_it_will_again(monkeypatch, folder, kernel, when):
    monkeypatch.setattr(module, "machine_code_folder", lambda: folder)
    assert made(kernel=kernel, compile_seconds=4.0)._compile_text() == f"about 4.0 s {when}"
    assert made(kernel=kernel)._compile_text() == ""


@pytest.mark.parametrize(("kept", "again"), [(True, 0.0), (False, 2.5)])
def test_a_forecast_has_what_is_to_be_compiled_again(monkeypatch, tmp_path, kept, again):
    asked = []

    def compiling(kernel, name, note):
        asked.append((name, note))
        return SimpleNamespace(kernel=kernel, seconds={"exact": 2.0, "rough": 0.5})

    monkeypatch.setattr(module, "Compiling", compiling)
    monkeypatch.setattr(module, "sampled_study", lambda study, compiling: "sample")
    monkeypatch.setattr(module, "with_ends", lambda sample, *_: sample)
    monkeypatch.setattr(module, "scaling", lambda study: SimpleNamespace(advice="one"))
    monkeypatch.setattr(module, "_is_kept", lambda name: kept)
    monkeypatch.setattr(module, "_forecast", lambda *words: (asked.append(words[1:]), made(seconds=7.0))[1])
    study = build(axes={"height": [1.0, 2.0]})
    found = module.plan(study, 3, tmp_path / "out.h5", note="note")
    assert (found.seconds, found.compile_seconds, found.scaling) == (7.0 + again, 2.5, "one")
    assert asked == [("toy:KERNEL", "note"), ("sample", 3, tmp_path, None)]
    monkeypatch.setattr(module, "cores", lambda: 5)
    monkeypatch.chdir(tmp_path)
    module.plan(study)
    assert asked[-1] == ("sample", 5, tmp_path, None)


def test_a_plan_for_no_folder_is_refused(tmp_path):
    path = tmp_path / "none" / "out.h5"
    with pytest.raises(module.SweepError) as fault:
        module.plan(build(axes={"height": [1.0]}), path=path)
    assert str(fault.value) == f"{path}: there is no folder {path.parent}"


@pytest.mark.parametrize(
    ("keys", "limits"),
    [({"isolate": True}, module.Limits()), ({"cell_timeout": 0.5}, module.Limits(0.5)), ({}, None)],
)
def test_a_plan_is_made_apart_where_that_is_asked_for(monkeypatch, tmp_path, keys, limits):
    asked = []
    monkeypatch.setattr(module, "_plan_apart", lambda *words: (asked.append(words[1:]), "apart")[1])
    monkeypatch.setattr(module, "sampled_study", lambda *words: pytest.skip("here") if limits else "sample")
    monkeypatch.setattr(module, "with_ends", lambda sample, *_: sample)
    monkeypatch.setattr(module, "scaling", lambda study: SimpleNamespace(advice=""))
    monkeypatch.setattr(module, "_forecast", lambda *words: made())
    found = module.plan(build(axes={"height": [1.0]}), 2, tmp_path / "out.h5", **keys)
    assert asked == ([(2, tmp_path, limits)] if limits else [])
    assert (found == "apart") is (limits is not None)


@pytest.mark.parametrize(
    ("output", "seconds"),
    [(1 << 28, 2.0 + 50.0), ((1 << 28) + 1, 2.0 + ((1 << 28) + 1) / 1e6), ((1 << 29), 2.0 + (1 << 29) / 1e6)],
)
def test_without_a_trial_the_slower_of_cells_and_disk_tells_the_time(monkeypatch, output, seconds):
    monkeypatch.setattr(module, "_disk_speed", lambda folder: 1e6)
    trial = SimpleNamespace(seconds=lambda folder: math.nan, cell_seconds=0.1, cells=1000)
    assert module._seconds(trial, output, 2, Path(), 2.0) == pytest.approx(seconds)
    trial.seconds = lambda folder: 7.0
    assert module._seconds(trial, output, 2, Path(), 2.0) == 7.0


def test_the_speed_of_the_disk_is_that_of_bytes_written_and_synced(tmp_path, monkeypatch):
    now, synced = iter([10.0, 32.0]), []
    monkeypatch.setattr(module, "TRIAL", 4096)
    monkeypatch.setattr(module.time, "perf_counter", lambda: next(now))
    monkeypatch.setattr(module.os, "fsync", lambda fd: synced.append(module.os.fstat(fd).st_size))
    assert module._disk_speed(tmp_path) == 4096 / 22
    assert synced == [4096]
    assert module._disk_speed(tmp_path / "nowhere") == math.inf
    assert module.WORTH_A_TRIAL == 1 << 28


def test_shares_are_counted_by_name():
    assert module._counted(np.array([-1, 1, 1, 1]), {-1: "none", 1: "exact"}) == {"none": 0.25, "exact": 0.75}


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.9995, "1 s"),
        (0.9994, "999 ms"),
        (0.99951e-3, "1 ms"),
        (0.9994e-3, "999 us"),
        (0.0009995, "999 us"),
        (1e-6, "1 us"),
        (0.0, "0 ns"),
        (3e-9, "3 ns"),
        (0.51e-6, "510 ns"),
        (70.0, "70 s"),
    ],
)
def test_short_times_at_the_borders_of_their_units(seconds, text):
    assert small_duration(seconds) == text


def test_a_forecast_adds_up(tmp_path, monkeypatch):
    study = build(axes={"height": np.arange(1.0, 1001.0)}, outputs=["fall_time", "impact_speed"])
    status = np.array([Status.OK, Status.OK, Status.OK, Status.BAD_INPUT], np.int8)
    sample = Sample(np.zeros(1), np.full(1, 1e-3), 32, status, np.array([1, 1, 1, -1], np.int8))
    asked = []
    monkeypatch.setattr(module, "_seconds", lambda *given: (asked.append(given), 3.0)[1])
    found = module._forecast(study, sample, 3, tmp_path, 5.0, 1.5)
    trial, output, workers, folder, starting = asked[0]
    # two float64, a float32, two bytes: 22 of a cell, in two buffers of a block for each worker
    assert found.memory_bytes == 2 * 3 * found.cells_per_block * 22
    assert (found.cells, found.shape, found.seconds, found.cell_seconds) == (1000, {"height": 1000}, 3.0, 1e-3)
    assert found.blocks == -(-1000 // found.cells_per_block)
    assert found.methods == {"none": 0.25, "exact": 0.75}
    assert found.statuses == {"OK": 0.75, "BAD_INPUT": 0.25}
    assert (output, workers, folder, starting) == (found.output_bytes, min(3, found.blocks), tmp_path, 1.5)
    assert (trial.cells, trial.block, trial.cell_timeout, trial.workers) == (1000, found.cells_per_block, 5.0, 3)
    assert trial.cell_bytes == found.output_bytes / 1000


class Apart:
    """Stands for processes of their own, whose clock is set by hand."""

    def __init__(self, advice):
        self.advice, self.ended, self.clock, self.asked = advice, False, None, []

    def solver(self):
        return self

    def end(self):
        self.ended = True

    def call(self, seconds, function, *words):
        self.asked.append((seconds, function))
        if isinstance(self.advice, Exception):
            raise self.advice
        return self.advice


@pytest.mark.parametrize(("starting", "told"), [(1.9, 0.0), (2.1, 2.1)])
@pytest.mark.parametrize(("cost", "timeout", "most"), [(0.05, 60.0, 1.0), (0.2, 60.0, 2.0), (0.2, 1.5, 1.5)])
def test_a_kernel_that_may_never_end_is_not_waited_for(monkeypatch, tmp_path, starting, told, cost, timeout, most):
    study = build(axes={"height": [1.0, 2.0]})
    sample = Sample(np.zeros(2), np.array([cost, cost / 2]), 1, None, None)
    processes, now, asked = Apart("one"), iter([5.0, 5.0 + starting]), []
    monkeypatch.setattr(module, "SILENT_SECONDS", 2.0)
    monkeypatch.setattr(module, "Processes", lambda study, limits, count: processes)
    monkeypatch.setattr(module, "warm", lambda solver, study: None)
    monkeypatch.setattr(module, "sampled_by", lambda solver, study, clock: sample)
    monkeypatch.setattr(module, "with_ends", lambda sample, *_: sample)
    monkeypatch.setattr(module.time, "monotonic", lambda: next(now))
    monkeypatch.setattr(module, "_forecast", lambda *given: (asked.append(given[-2:]), made())[1])
    found = module._plan_apart(study, 2, tmp_path, module.Limits(timeout))
    assert (found.compile_seconds, found.scaling) == (pytest.approx(told), "one")
    assert asked == [(pytest.approx(most), pytest.approx(starting))]
    assert processes.ended
    assert processes.asked == [(10.0, module.advice_on)]


def test_what_fails_at_random_cells_is_told_in_place_of_advice(monkeypatch, tmp_path):
    processes = Apart(module.Unsolved("it died"))
    monkeypatch.setattr(module, "Processes", lambda study, limits, count: processes)
    monkeypatch.setattr(module, "warm", lambda solver, study: None)
    monkeypatch.setattr(module, "sampled_by", lambda *given: Sample(np.zeros(1), np.ones(1), 1, None, None))
    monkeypatch.setattr(module, "with_ends", lambda sample, *_: sample)
    monkeypatch.setattr(module, "_forecast", lambda *given: made())
    found = module._plan_apart(build(axes={"height": [1.0]}), 2, tmp_path, module.Limits(1.0))
    assert found.scaling == "not known; while cells were tried at random, it died"
    assert processes.ended


def test_what_a_summary_reduces_at_a_time_takes_memory_too(tmp_path, monkeypatch):
    summary = {"outputs": {"fall_time": ["min"]}}
    study = build(axes={"height": np.arange(1.0, 1001.0)}, summary=summary)
    codes = np.zeros(4, np.int8)
    monkeypatch.setattr(module, "_seconds", lambda *given: 3.0)
    monkeypatch.setattr(module, "row_blocks", lambda study: RowBlocks(1, 1000, 1000))
    found = module._forecast(study, Sample(np.zeros(1), np.ones(1), 32, codes, codes), 3, tmp_path, None)
    row = sum(column.cell_bytes for column in module.part_columns(study))
    assert found.memory_bytes == 2 * 3 * (row + 65536 * 10)
    assert (found.cells, found.cells_per_block) == (1000, 1000)
