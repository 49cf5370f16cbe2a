"""Cells at which some method fails at either end of the tolerances are left out."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from toy_studies import build

from kernels.interface import Status
from sweep.explore.failing import without_failing
from sweep.system.errors import SweepError


@pytest.fixture
def failing(monkeypatch):
    """A function that says at which heights, by method and rtol, a run fails; what was asked for is kept."""
    asked = []

    def set_up(bad):
        def run(study, progress, isolate, cell_timeout):
            asked.append((study.method, study.rtol, progress, isolate, cell_timeout))
            heights = study.axes["height"].values
            fails = np.isin(heights, bad.get((study.method, study.rtol), []))
            return xr.Dataset({"status": ("cell", np.where(fails, int(Status.FAILED), 0))})

        monkeypatch.setattr("sweep.runs.run.run", run)
        return asked

    return set_up


def heights():
    return replace(build(axes={"height": np.arange(1.0, 6.0)}), design="zip")


def test_what_any_method_fails_at_is_left_out_and_told(failing):
    asked, told = failing({("rough", 1e-3): [3.0], ("exact", 1e-14): [5.0, 3.0]}), []
    found = without_failing(heights(), 2.0, told.append)
    assert found.axes["height"].values.tolist() == [1.0, 2.0, 4.0]
    assert told == ["the kernel fails at 2 of 5 cells, e.g. height=3; they are left out"]
    trials = [(method, rtol) for method in ("auto", "rough", "exact") for rtol in (1e-3, 1e-14)]
    assert sorted(asked) == sorted((*trial, False, True, 2.0) for trial in trials)


def test_where_nothing_fails_the_study_stays_and_where_all_do_that_is_told(failing):
    failing({})
    study, told = heights(), []
    assert without_failing(study, None, told.append) is study
    assert told == []
    failing({("exact", 1e-3): [1.0, 2.0, 3.0, 4.0, 5.0]})
    with pytest.raises(SweepError, match=r"the kernel fails at 5 of 5 cells, e\.g\. height=1$"):
        without_failing(study, None, told.append)
