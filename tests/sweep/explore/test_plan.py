import errno
import re
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from running import fail_on, tall

import sweep
from sweep.cells.grid import Grid
from sweep.explore import calibration
from sweep.explore.calibration import thinned
from sweep.explore.plan import plan, small_duration
from sweep.runs.run import run
from sweep.system.errors import SweepError
from sweep.system.progress import quantity


def stone(**keys):
    keys = {"axes": {"height": np.linspace(-1.0, 9.0, 500), "v0": [0.0, 0.5]}, "outputs": ["fall_time"], **keys}
    return sweep.study(allow_import=True, kernel="toy:KERNEL", title="A stone", **keys)


def test_a_plan_forecasts_bytes_that_a_run_then_takes(tmp_path):
    study = stone()
    found = plan(study, path=tmp_path / "out.h5")
    assert found.cells == 1000
    # a float64, an error bound, a status and a method
    assert 14_000 <= found.output_bytes <= 64_000
    run(study, tmp_path / "out.h5", progress=False).close()
    assert (tmp_path / "out.h5").stat().st_size == pytest.approx(found.output_bytes, rel=0.3)


def test_traces_count_with_their_length():
    traces = stone(outputs=["drop"], along={"phase": np.linspace(0, 1, 200)})
    assert plan(traces).output_bytes > 1000 * (200 * 8 + 2)


def slow(count):
    keys = {"axes": {"height": np.arange(1.0, count + 1)}, "outputs": ["fall_time"]}
    return sweep.study(allow_import=True, kernel="slow:SLOW", **keys)


@pytest.mark.parametrize("count", [60, 1000])
def test_a_plan_forecasts_the_time_of_a_run(tmp_path, count):
    """Two milliseconds a cell by sleeping, and what any run costs."""
    found = plan(slow(count), workers=2, path=tmp_path / "out.h5")
    begun = time.perf_counter()
    run(slow(count), tmp_path / "out.h5", workers=2, progress=False).close()
    assert 2e-3 <= found.cell_seconds < 2e-2
    assert found.seconds == pytest.approx(time.perf_counter() - begun, rel=0.6)
    assert found.blocks >= 1


@pytest.mark.parametrize("why", ["no room", "dear"])
def test_where_nothing_can_be_tried_the_probes_alone_tell_the_time(tmp_path, monkeypatch, why):
    if why == "no room":
        fail_on(monkeypatch, "reserve", 1, errno.ENOSPC)
    else:
        monkeypatch.setattr(calibration, "CALIBRATION_SECONDS", 1e-3)
    found = plan(slow(100), workers=2, path=tmp_path / "out.h5")
    assert found.seconds == pytest.approx(100 * found.cell_seconds / 2)
    assert list(tmp_path.iterdir()) == []


@given(fixed=st.floats(0.0, 10.0), each=st.floats(1e-6, 1.0), some=st.integers(1, 1500))
@settings(max_examples=30, deadline=None)
def test_two_trial_runs_tell_what_any_run_costs_from_what_cells_cost(fixed, each, some):
    class Trial(calibration.Calibration):
        def _timed(self, study, path):
            size = Grid(study).size
            return calibration.Timed(size, fixed + each * size)

    found = Trial(slow(1000), 1000, block=1, cell_seconds=0.0, cell_bytes=0.0, workers=1)._forecast(None, some)
    assert found == pytest.approx(fixed + 1000 * each if some > 1 else 1000 * (fixed + each))


@pytest.mark.parametrize(("cells", "block"), [(40, 7), (12, 3), (2, 1)])
def test_a_trial_of_the_whole_study_has_its_blocks_and_a_smaller_one_two_a_worker(tmp_path, monkeypatch, cells, block):
    asked = []
    monkeypatch.setattr("sweep.runs.run.run", lambda *given, **keys: (asked.append(keys), run(*given, **keys))[1])
    study = stone(axes={"height": np.arange(1.0, 41)})
    trial = calibration.Calibration(study, 40, block=7, cell_seconds=0.0, cell_bytes=0.0, workers=2)
    trial._timed(thinned(study, cells), tmp_path / "trial.h5")
    assert [keys["block_cells"] for keys in asked] == [block]


@pytest.mark.parametrize("design", ["product", "zip"])
@settings(max_examples=60, deadline=None)
@given(lengths=st.lists(st.integers(1, 40), min_size=2, max_size=2), cells=st.integers(1, 2000))
def test_a_thinned_study_has_about_so_many_cells_from_all_over_its_axes(design, lengths, cells):
    if design == "zip":
        lengths = lengths[:1] * 2
    axes = {"height": np.arange(1.0, lengths[0] + 1), "v0": np.arange(1.0, lengths[1] + 1)}
    study = stone(axes=axes, design=design)
    few = thinned(study, cells)
    size, wanted = Grid(few).size, min(cells, Grid(study).size)
    assert wanted / 2 - 1 <= size <= max(wanted, 64)
    for name, axis in few.axes.items():
        assert set(axis.values) <= set(study.axes[name].values)
        assert (np.diff(axis.values) > 0).all()
        if len(axis) > 1:
            gaps = np.diff(np.r_[0, axis.values, len(study.axes[name])])
            assert gaps.max() <= 2 * len(study.axes[name]) / len(axis) + 1


def test_a_plan_tells_what_auto_would_choose_and_what_becomes_of_cells():
    found = plan(stone(rtol=0.5))
    assert found.methods.keys() == {"none", "rough"}
    assert sum(found.methods.values()) == pytest.approx(1)
    assert 0.05 < found.statuses["BAD_INPUT"] < 0.25  # a tenth of the cells, and both ends of a small sample


@pytest.mark.parametrize("isolate", [False, True])
@pytest.mark.parametrize("end", [0, -1])
def test_the_ends_of_axes_are_in_the_sample_whose_size_is_told(tmp_path, end, isolate):
    """One cell at the end of a long axis is refused, and by another method than the others: the plan says so."""
    heights, speeds = np.linspace(1.0, 9.0, 5000), np.linspace(0.0, 0.1, 5)
    heights[end] = -1.0
    for axes in ({"height": heights}, {"v0": speeds, "height": heights}):
        found = plan(stone(axes=axes, rtol=0.5), path=tmp_path / "out.h5", isolate=isolate)
        assert 0 < found.statuses["BAD_INPUT"] < 0.3
        assert found.methods.keys() == {"none", "rough"}
        assert f"of a sample of {found.sampled:,} cells" in str(found)
        assert " 0 %" not in str(found)


def test_a_plan_reads_well():
    text = str(plan(stone(), workers=2))
    assert text.startswith(
        "A stone\n  kernel    toy:KERNEL\n  outputs   fall_time\n  cells     1,000 = height 500 x v0 2\n"
    )
    for row in ("blocks", "output", "disk", "memory", "time", "methods", "statuses"):
        assert re.search(rf"^  {row:9} \S", text, re.MULTILINE), row
    assert "warning" not in text


def test_a_plan_warns_of_a_disk_that_is_too_small(monkeypatch):
    found = plan(stone())
    free = shutil.disk_usage(".")._replace(free=found.output_bytes - 1)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: free)
    assert re.search(r"warning +the disk is too small: .* needed, .* free", str(plan(stone())))


def test_a_plan_warns_of_a_memory_that_is_too_small(monkeypatch):
    monkeypatch.setattr(sys.modules["sweep.explore.plan"], "memory", lambda: 1000)
    assert "the memory is too small" in str(plan(stone()))


def test_a_plan_of_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(SweepError, match="there is no folder"):
        plan(stone(), path=tmp_path / "nowhere" / "out.h5")


def test_a_plan_leaves_nothing_on_the_disk(tmp_path):
    plan(stone(), path=tmp_path / "out.h5")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("count", "text"),
    [
        (0, "0 B"),
        (812, "812 B"),
        (999, "999 B"),
        (1000, "1 kB"),
        (1340, "1.34 kB"),
        (42_000_000, "42 MB"),
        (3.2e12, "3.2 TB"),
    ],
)
def test_bytes_read_as_people_say_them(count, text):
    assert quantity(count) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(5.1e-9, "5.1 ns"), (999e-9, "999 ns"), (0.9996e-6, "1 us"), (2e-5, "20 us"), (3.4e-3, "3.4 ms"), (2.0, "2 s")],
)
def test_short_times_read_as_people_say_them(seconds, text):
    assert small_duration(seconds) == text


def test_the_engine_is_imported_without_heavy_libraries():
    code = """
import sys, sweep.runs.run, sweep.explore.plan, sweep.results.open, sweep.store.store, sweep.system.progress
print(sorted({"numba", "xarray", "h5py", "h5netcdf", "pint", "dask", "pandas"} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_kernel_that_crashes_or_never_ends_is_planned_in_processes_of_its_own(tmp_path):
    found = plan(tall(200, "bad:WORST"), path=tmp_path / "out.h5", cell_timeout=1.0)
    assert found.cells == 200
    assert found.methods == {"exact": 1.0}
    assert 0 < found.seconds < 600
    assert list(tmp_path.iterdir()) == []


def test_cells_that_are_tried_at_random_may_raise(monkeypatch):
    """One in three of those that scalings are sought with."""

    def misbehave(height, kinds):
        if (height % 1 > 2 / 3).any():
            raise ValueError

    monkeypatch.setattr("bad.misbehave", misbehave)
    assert plan(tall(60, "bad:RAISING")).cells == 60


def test_a_plan_of_a_kernel_that_dies_of_random_cells_says_so(tmp_path):
    """Whole heights are well; others, at which scalings are tried, are not."""
    text = plan(tall(50, "bad:WHOLE"), path=tmp_path / "out.h5", isolate=True).scaling
    assert text == "not known; while cells were tried at random, its process died of SIGSEGV"
