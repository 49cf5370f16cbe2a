"""Steps of a chart of speed against accuracy: what is measured of a method, on statuses and errors set by hand."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from toy import KERNEL
from toy_studies import build

from kernels.interface import Field, Method, Status
from sweep.explore import work_precision as module
from sweep.explore.reference import Reference

OK, INACCURATE, GRAZING = Status.OK, Status.INACCURATE, Status.GRAZING
REFUSED, GIVEN_UP = Status.BAD_INPUT, Status.STEP_LIMIT


def measured(monkeypatch, error, status, *, void=None, floor=1e-12, rtol=1e-6, used=None, source="exact"):
    """Of cells with these errors and statuses, the truth of all but the void ones known to `floor`."""
    size = len(error)
    study = build(axes={"height": np.arange(1.0, size + 1)}, outputs=["impact_speed"])
    used = np.zeros(size, int) if used is None else np.array(used)
    outputs = {"impact_speed": 1 + np.array(error), "steps": np.arange(size) * 1.0}
    monkeypatch.setattr(module, "solved", lambda part: (outputs, np.array(status, np.int8), used, None))
    void = np.zeros(size, bool) if void is None else np.array(void)
    against = Reference(source, {"impact_speed": np.ones(size)}, np.full(size, floor), ~void, void)
    return module._measured(study, "rough", rtol, against)


def test_shares_of_cells_by_hand(monkeypatch):
    status = [OK, OK, OK, INACCURATE, GRAZING, REFUSED, GIVEN_UP, REFUSED]
    found = measured(monkeypatch, [0.25, 0.5, 0, 1, 2, 9, 9, 9], status)
    shares = {key: found[key] for key in ("ok", "remarked", "inaccurate", "unsolved", "silent")}
    assert shares == {"ok": 3 / 8, "remarked": 1 / 8, "inaccurate": 1 / 8, "unsolved": 3 / 8, "silent": 2 / 8}
    assert (found["error_median"], found["error_worst"]) == (0.5, 0.5)
    assert (found["worst_cell"], found["silent_at"]) == ("height=2", "height=1")
    assert found["unsolved_as"] == "BAD_INPUT at height=6"
    assert found["steps"] == 2.0  # of the cells with values
    assert found["methods_used"] == "rough 100 %"


def test_low_and_high_leave_a_tenth_of_the_cells_beyond_each(monkeypatch):
    error = np.arange(1.0, 21.0)
    found = measured(monkeypatch, error, [OK] * 20)
    assert (found["error_low"], found["error_median"], found["error_high"]) == (2.0, 10.5, 18.0)


def test_nothing_known_of_a_method_that_solves_nothing(monkeypatch):
    found = measured(monkeypatch, [1.0, 1.0], [REFUSED, GIVEN_UP])
    assert all(math.isnan(found[f"error_{key}"]) for key in ("median", "low", "high", "worst"))
    assert math.isnan(found["steps"])
    assert (found["unsolved"], found["worst_cell"], found["silent_at"]) == (1.0, "", "")
    unsure = measured(monkeypatch, [1.0, 1.0], [INACCURATE, GRAZING])
    assert (unsure["error_median"], unsure["worst_cell"]) == (1.0, "")
    assert math.isnan(unsure["error_worst"])


@pytest.mark.parametrize(("error", "silent"), [(2.0**-19, 0), (2.0**-19 + 2.0**-40, 1)])
def test_wrong_is_more_than_rtol_and_what_the_truth_is_right_to(monkeypatch, error, silent):
    found = measured(monkeypatch, [error], [OK], rtol=2.0**-20, floor=2.0**-20)
    assert found["silent"] == silent


def test_in_a_void_cell_only_ok_is_wrong(monkeypatch):
    status = [OK, INACCURATE, GRAZING, REFUSED]
    found = measured(monkeypatch, [0.0] * 4, status, void=[True] * 4)
    assert (found["silent"], found["silent_at"], found["ok"], found["unsolved"]) == (0.25, "height=1", 0.0, 0.0)


def test_what_the_reference_solved_itself_is_off_by_what_it_is_right_to(monkeypatch):
    found = measured(monkeypatch, [0.0, 0.0, 1e-3], [OK] * 3, floor=1e-4, used=[1, 0, 1])
    assert (found["error_worst"], found["error_low"]) == (pytest.approx(1e-3), 0.0)
    assert found["methods_used"] == "rough 33.3 %, exact 66.7 %"
    assert found["error_median"] == 1e-4


def test_methods_of_no_cell_are_not_named():
    study = build(axes={"height": [1.0, 2.0]})
    assert module._shares(study, np.array([-1, -1])) == ""
    assert module._shares(study, np.array([-1, 1])) == "exact 100 %"


def test_an_error_of_the_reference_itself_is_told_only_above_its_floor():
    attributes = {"reference": "exact", "reference_error": 1e-9}
    assert module._error(1e-9, attributes, "exact") == "reference"
    assert module._error(1.1e-9, attributes, "exact") == "1.1e-09"
    assert module._error(1e-10, attributes, "rough") == "1.0e-10"


def test_omissions_name_each_tolerance_and_the_first_place():
    found = xr.Dataset(
        {
            "unsolved": (("method", "rtol"), [[0.0, 0.25, 0.5]]),
            "silent": (("method", "rtol"), [[0.125, 0.0, 0.0]]),
            "unsolved_as": (("method", "rtol"), [["", "FAILED at a", "FAILED at b"]]),
            "silent_at": (("method", "rtol"), [["c", "", ""]]),
        },
        {"method": ["m"], "rtol": [1e-3, 1e-4, 1e-5]},
    )
    assert module.omissions(found) == [
        "m does not solve 25 % at 1e-04, 50 % at 1e-05, first FAILED at a",
        "m is silently wrong in 12.5 % at 1e-03, first c",
    ]


def test_the_least_of_five_rounds_over_all_methods_counts(monkeypatch):
    asked, times = [], iter(range(100, 0, -1))
    monkeypatch.setattr(module, "with_method", lambda study, name, rtol: (name, rtol))
    monkeypatch.setattr(module, "_timed", lambda part: (asked.append(part), next(times))[1])
    found = module._seconds(None, ["a", "b"], [1e-3, 1e-6])
    assert found.tolist() == [[84.0, 83.0], [82.0, 81.0]]
    assert asked == 5 * [("a", 1e-3), ("a", 1e-6), ("b", 1e-3), ("b", 1e-6)]


@pytest.mark.parametrize(("seconds", "calls"), [(0.003, 4), (0.02, 1)])
def test_cells_are_solved_again_until_a_hundredth_of_a_second_is_over(monkeypatch, seconds, calls):
    now, solved = [5.0], []

    def solve(start, cells):
        solved.append((start, cells.number))
        now[0] += seconds

    monkeypatch.setattr("sweep.cells.solve.Solver", lambda study: SimpleNamespace(solve=solve))
    monkeypatch.setattr(module.time, "thread_time", lambda: now[0])
    assert module._timed(build(axes={"height": np.arange(1.0, 9.0)})) == pytest.approx(seconds / 8)
    assert solved == [(0, 8)] * calls


def test_work_and_estimates_are_not_compared_unless_nothing_else_is_asked():
    extra = tuple(Field(name, "1", name) for name in ("steps", "error"))
    study = build(axes={"height": [1.0]})
    study = replace(study, kernel=replace(KERNEL, outputs=(*KERNEL.outputs, *extra)))
    some = replace(study, outputs=("fall_time", "steps", "error"))
    assert module._without_work(some).outputs == ("fall_time",)
    assert module._without_work(replace(study, outputs=("steps", "error"))).outputs == ("steps", "error")


def test_methods_left_out_are_told_with_all_that_they_cannot_do():
    study = build(axes={"height": [1.0], "v0": [1.0]}, outputs=["fall_time", "impact_speed"])
    methods = (
        Method("able", "", None),
        Method("narrow", "", None, excludes=("v0", "g"), lacks=("fall_time",)),
        Method("dumb", "", None, lacks=("fall_time", "drop", "impact_speed")),
    )
    study = replace(study, kernel=replace(KERNEL, methods=methods))
    told = module._missing(study, ["able"])
    assert told[0].startswith("narrow cannot do v0")
    assert told[1:] == ["dumb does not give fall_time, impact_speed"]
