"""What a plan forecasts, against the run; what it says of methods, statuses, small disks and bad kernels."""

from types import SimpleNamespace

import numpy as np
import pytest
from running import tall
from toy_studies import build

import sweep


def stone(**keys):
    return build(**{"axes": {"height": np.linspace(-1.0, 9.0, 500), "v0": [0.0, 0.5]}, "title": "A stone", **keys})


@pytest.mark.parametrize("keys", [{}, {"outputs": ["drop"], "along": {"phase": np.linspace(0, 1, 50)}}])
def test_a_plan_forecasts_bytes_that_a_run_then_takes(tmp_path, keys):
    study = stone(**keys)
    found = sweep.plan(study, path=tmp_path / "out.h5")
    assert list(tmp_path.iterdir()) == []
    assert found.cells == 1000
    assert found.shape == {"height": 500, "v0": 2}
    assert (found.blocks - 1) * found.cells_per_block < 1000 <= found.blocks * found.cells_per_block
    sweep.run(study, tmp_path / "out.h5", progress=False).close()
    assert (tmp_path / "out.h5").stat().st_size == pytest.approx(found.output_bytes, rel=0.3)


def test_a_plan_forecasts_the_time_of_a_run(monkeypatch):
    """By a clock on which a cell takes two milliseconds, and nothing else takes any."""
    plan, now = sweep.plan, [0.0]  # imported before the clock is another
    monkeypatch.setattr("slow.time", SimpleNamespace(sleep=lambda seconds: now.append(now[-1] + seconds)))
    monkeypatch.setattr("sweep.cells.timing.work_clock", lambda: now[-1])
    found = plan(build(kernel="slow:SLOW", axes={"height": np.arange(1.0, 1001)}), workers=2)
    assert found.cell_seconds == pytest.approx(2e-3)
    assert found.seconds == pytest.approx(1.0, abs=0.2)


def test_a_plan_tells_what_auto_would_choose_and_what_becomes_of_cells():
    found = sweep.plan(stone(rtol=0.5))
    assert found.methods == pytest.approx({"rough": 0.896, "none": 0.1, "exact": 0.004}, abs=0.06)
    assert found.statuses == pytest.approx({"OK": 0.9, "BAD_INPUT": 0.1}, abs=0.06)


@pytest.mark.parametrize("isolate", [False, True])
@pytest.mark.parametrize("end", [0, -1])
def test_the_ends_of_axes_are_in_the_sample_whose_size_is_told(tmp_path, end, isolate):
    """One cell at the end of a long axis is refused, and by another method than the others: the plan says so."""
    heights, speeds = np.linspace(1.0, 9.0, 5000), np.linspace(0.0, 0.1, 5)
    heights[end] = -1.0
    for axes in ({"height": heights}, {"v0": speeds, "height": heights}):
        found = sweep.plan(stone(axes=axes, rtol=0.5), path=tmp_path / "out.h5", isolate=isolate)
        assert 0 < found.statuses["BAD_INPUT"] < 0.6  # of a sample that is small on a busy machine
        assert found.methods.keys() == {"none", "rough"}
        assert f"{found.sampled:,} cells" in repr(found)
        assert " 0 %" not in str(found)


def test_a_plan_of_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(sweep.SweepError, match="no folder"):
        sweep.plan(stone(), path=tmp_path / "nowhere" / "out.h5")


def test_a_kernel_that_crashes_or_never_ends_is_planned_in_processes_of_its_own(tmp_path):
    found = sweep.plan(tall(66, "bad:WORST"), path=tmp_path / "out.h5", cell_timeout=1.0)  # the last cell is bad, too
    assert found.cells == 66
    assert found.methods["exact"] >= 0.25
    assert found.statuses["FAILED"] > 0
    assert 0 < found.seconds < 600
    assert list(tmp_path.iterdir()) == []


def test_cells_at_which_scalings_are_tried_may_raise():
    """Whole heights do no harm; others, at which scalings are tried, do."""
    assert sweep.plan(tall(60, "bad:RAISING")).cells == 60
