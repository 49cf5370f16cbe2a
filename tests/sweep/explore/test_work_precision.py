"""Errors and times of methods on the same cells: what is right, what is silently wrong, what fails, and who says so."""

import re
from dataclasses import replace

import numpy as np
import pytest
from running import tall
from toy import KERNEL, exact, rough
from toy_studies import build

import sweep
from kernels.interface import FIRST_REFUSAL, Field, Method, Status
from sweep.explore.work_precision import precision_cells, precision_text

HEIGHTS = np.array([1.0, 2.0, 5.0, 10.0])
SPEEDS = np.array([0.0, 1e-3, 0.1, 3.0])
G = 9.80665
TRUTH = np.hypot(SPEEDS, np.sqrt(2 * G * HEIGHTS))
EXACT = Method("exact", "", exact)
LAST = "height=10 v0=3"
"""The cell in which the methods below are bad."""


def stones(*methods, heights=HEIGHTS, speeds=SPEEDS, outputs=KERNEL.outputs, **keys):
    """Four stones; those thrown faster are further from `rough`."""
    axes = {"height": heights, "v0": speeds}
    study = build(**{"design": "zip", "axes": axes, "outputs": ["impact_speed"], **keys})
    return replace(study, kernel=replace(KERNEL, methods=methods or KERNEL.methods, outputs=outputs))


def bad(share=0.0, status=lambda rtol: Status.OK):
    """As `exact`, but at 10 m off by a share, with a status that may depend on rtol."""

    def solve(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said):
        exact(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said)
        impact_speed[height == 10.0] *= 1 + share
        said[height == 10.0] = status(rtol[0])

    return solve


def saying(status, name="it", share=0.0, bound=None):
    return Method(name, "", bad(share, lambda rtol: status), bound)


def chart(study, **options):
    return sweep.work_precision(study, **{"tolerances": [1e-3, 1e-6], **options})


def at(found, method, rtol=1e-6):
    return found.sel({"method": method, "rtol": rtol})


def shares(cell):
    return {name: float(cell[name]) for name in ("ok", "remarked", "inaccurate", "unsolved", "silent") if cell[name]}


def test_errors_are_those_against_the_truth():
    found = chart(stones(), reference="exact")
    off = 1 - np.sqrt(2 * G * HEIGHTS) / TRUTH
    cell = at(found, "rough")
    # of cells said to be right to 1e-6 the worst is the second: its bound v0^2/(4 g h) is 1.3e-8
    assert float(cell.error_worst) == pytest.approx(off[1], rel=1e-6)
    assert float(cell.error_median) == pytest.approx(np.median(off), rel=1e-9)
    assert cell.worst_cell.item() == "height=2 v0=0.001"
    assert shares(cell) == {"ok": 0.5, "inaccurate": 0.5}
    assert float(at(found, "exact").error_worst) == found.attrs["reference_error"] == 1e-14
    assert (found.seconds > 0).all()
    unsure = chart(stones(saying(Status.INACCURATE), EXACT, heights=[10.0], speeds=[0.0]), reference="exact")
    assert at(unsure, "it").worst_cell.item() == ""


def test_a_number_below_the_normal_ones_that_has_few_digits_is_not_silently_wrong():
    keys = {"kernel": "foliot", "outputs": ["multiplier"], "axes": {"mu": [0.0014454397707459276]}}
    found = chart(keys | {"fixed": {"phi0": 0.5235987755982989, "a": 1.0}}, methods=["quadrature"], tolerances=[1e-9])
    assert shares(found.squeeze()) == {"ok": 1.0}


def test_auto_is_measured_beside_the_methods_and_says_which_it_took():
    found = chart(stones())
    assert found.method.values.tolist() == ["auto", "rough", "exact"]
    assert at(found, "auto").methods_used.item() == "rough 50 %, exact 50 %"
    assert shares(at(found, "auto")) == {"ok": 1.0}
    assert float(at(found, "auto").error_worst) >= found.attrs["reference_error"] > 0


@pytest.mark.parametrize(
    ("method", "found", "words"),
    [
        (saying(Status.OK, share=1.1e-6), {"ok": 1.0, "silent": 0.25}, f"wrong in 25 % at 1e-06, first {LAST}"),
        (saying(Status.OK, share=0.9e-6), {"ok": 1.0}, ""),
        (saying(Status.OK, share=np.nan), {"ok": 0.75, "unsolved": 0.25}, f"first FAILED at {LAST}"),
        (saying(Status.INACCURATE, share=1.0), {"ok": 0.75, "inaccurate": 0.25}, ""),
        (saying(Status.GRAZING, share=1.0), {"ok": 0.75, "remarked": 0.25}, ""),
        (saying(Status.COMES_TO_REST, share=1.0), {"ok": 0.75, "remarked": 0.25, "silent": 0.25}, "silently wrong"),
        (saying(Status.STEP_LIMIT), {"ok": 0.75, "unsolved": 0.25}, f"first STEP_LIMIT at {LAST}"),
    ],
)
def test_a_cell_is_judged_by_its_status_and_its_error(method, found, words):
    measured = chart(stones(method, EXACT), reference="exact")
    assert shares(at(measured, "it")) == found
    assert words in measured.attrs["omissions"]
    if "unsolved" in found:
        assert "auto does not solve" not in measured.attrs["omissions"]  # it went on to exact


def test_a_value_where_there_is_nothing_to_give_is_silently_wrong():
    sure = chart(stones(EXACT, saying(Status.NEVER_STARTS, "sure")), reference="sure")
    assert shares(at(sure, "exact")) == {"ok": 0.75, "silent": 0.25}
    weak = chart(stones(EXACT, saying(Status.NOT_CONVERGED, "weak")), reference="weak")  # to give up is to say nothing
    assert shares(at(weak, "exact")) == {"ok": 1.0}
    assert (weak.attrs["cells"], weak.attrs["open_cells"]) == (3, 1)


def test_cells_that_check_refuses_are_judged_by_their_refusal():
    found = chart(stones(speeds=[0.0, -1.0, np.nan, 1.0]))
    assert found.attrs["cells"] == 4
    assert shares(at(found, "exact")) == {"ok": 0.5}


def test_methods_that_cannot_do_the_study_are_named_as_omitted():
    narrow = Method("narrow", "", rough, excludes=("v0", "g"), lacks=("drop",))
    assert chart(stones(narrow, EXACT)).attrs["omissions"] == "narrow cannot do v0"
    still = stones(narrow, EXACT, outputs=KERNEL.outputs, design="product", axes={"height": HEIGHTS},
                   along={"phase": {"num": 3}})  # fmt: skip
    found = chart(replace(still, outputs=("drop",)))
    assert found.attrs["omissions"] == "narrow does not give drop"
    assert found.method.values.tolist() == ["auto", "exact"]
    with pytest.raises(sweep.SweepError, match="no method"):
        chart(stones(narrow))


def tight(height, v0, g, rtol, phase, asked, out):
    out[...] = 1e-15


FINE, OPEN = bad(), bad(status=lambda rtol: Status.STEP_LIMIT)
COARSE = bad(status=lambda rtol: Status.INACCURATE if rtol < 0.9e-9 else Status.OK)


@pytest.mark.parametrize(
    ("methods", "reference"),
    [
        ([("open", OPEN, tight), ("plain", FINE, None)], "plain"),
        ([("plain", OPEN, None), ("open", OPEN, tight)], "open"),
        ([("plain", FINE, None), ("bounded", COARSE, tight)], "bounded"),
        ([("coarse", COARSE, tight), ("fine", FINE, tight)], "fine"),
    ],
)
def test_the_reference_leaves_the_fewest_cells_open_then_states_a_bound_then_has_the_most_digits(methods, reference):
    study = stones(*(Method(name, "", solve, bound) for name, solve, bound in methods))
    assert chart(study).attrs["reference"] == reference


def test_in_each_cell_the_least_rtol_at_which_the_reference_says_ok_counts():
    """At 10 m that is 1e-9, and its value is 2e-9 off; elsewhere it is 1e-14."""

    def coarse(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said):
        COARSE(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said)
        impact_speed *= 1 + 2 * rtol

    found = chart(stones(EXACT, Method("coarse", "", coarse)), reference="coarse", tolerances=[1e-12, 0.5e-9])
    assert found.attrs["reference_error"] == pytest.approx(1e-9)
    assert float(at(found, "exact", 1e-12).error_worst) == pytest.approx(2e-9, rel=1e-3)
    assert float(at(found, "exact", 1e-12).error_median) < 1e-12
    assert float(at(found, "exact", 1e-12).silent) == 0.25  # 2e-9 is more than rtol and the floor together
    for status in (Status.INACCURATE, FIRST_REFUSAL):
        never = chart(stones(EXACT, saying(status, "never")), reference="never")
        assert (never.attrs["cells"], never.attrs["open_cells"]) == ((3, 1) if status == Status.INACCURATE else (4, 0))
    assert chart(stones(EXACT, saying(Status.GRAZING, "grazing")), reference="grazing").attrs["open_cells"] == 0


@pytest.mark.parametrize(
    ("truth", "worst", "silent"),
    [
        (TRUTH, 0.0, 0.0),
        (TRUTH * [1, 1, 1, 1.01], 0.01 / 1.01, 0.25),
        (TRUTH * [1, 1, 1, np.nan], 0.0, 0.25),  # nothing to give in the last cell
        (TRUTH * [1, 0, 0, 0], np.inf, 0.75),
        (-TRUTH, 2.0, 1.0),
    ],
)
def test_given_truth_is_taken_as_it_is(truth, worst, silent):
    study = stones()
    np.testing.assert_array_equal(precision_cells(study)["height"], HEIGHTS)
    found = at(chart(study, truth={"impact_speed": truth}), "exact")
    assert float(found.error_worst) == pytest.approx(worst, abs=1e-14)
    assert float(found.silent) == silent


def test_traces_are_compared_relative_to_their_largest_value_and_the_worst_output_counts():
    keys = {"outputs": ["drop", "impact_speed"], "axes": {"height": [2.0]}, "along": {"phase": [0.5, 1.0]}}
    speed = [np.sqrt(2 * G * 2.0)]
    for drop in ([0.5, 2.0 + 1e-4], [0.5 + 1e-4, 2.0]):
        found = chart(build(**keys), truth={"drop": [drop], "impact_speed": speed})
        assert float(at(found, "exact").error_worst) == pytest.approx(0.5e-4, rel=1e-3)
    found = chart(build(**keys), truth={"drop": [[0.5, 2.0 + 1e-4]], "impact_speed": np.multiply(speed, 1.01)})
    assert float(at(found, "exact").error_worst) == pytest.approx(0.01 / 1.01, rel=1e-9)


def test_counts_of_work_and_estimates_of_error_are_not_compared():
    def counted(height, v0, g, rtol, phase, fall_time, impact_speed, drop, steps, error, wear_error, status):
        exact(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status)
        steps[:] = -np.log10(rtol) + (height == 10.0)
        error[:] = wear_error[:] = rtol

    extra = tuple(Field(name, "1", name, integer=name == "steps") for name in ("steps", "error", "wear_error"))
    study = stones(Method("counted", "", counted), outputs=(*KERNEL.outputs, *extra))
    found = chart(replace(study, outputs=("impact_speed", "steps", "error", "wear_error")))
    assert found.steps.sel({"method": "counted"}).values == pytest.approx([3.25, 6.25])
    assert float(found.error_worst.max()) == found.attrs["reference_error"]
    assert "  steps  " in precision_text(found, complete=True)


def test_of_many_tolerances_the_middle_one_is_printed_and_all_of_them_by_wish():
    tolerances = (1e-3, 1e-6, 1e-9, 1e-12)
    found = chart(stones(saying(Status.STEP_LIMIT), EXACT), reference="exact", tolerances=tolerances)
    short, complete = precision_text(found), precision_text(found, complete=True)
    assert re.findall(r"^  it +(\S+)", short, re.MULTILINE) == ["1e-09"]
    assert len(re.findall(r"^  it +(\S+)", complete, re.MULTILINE)) == 4
    assert "it does not solve 25 % at 1e-03, first STEP_LIMIT" in " ".join(short.split())


def test_a_share_is_told_where_two_tolerances_have_the_same_first_digit():
    loose = Method("it", "", bad(0.0, lambda rtol: Status.STEP_LIMIT if rtol > 1.1e-3 else Status.OK))
    found = chart(stones(loose, EXACT), reference="exact", tolerances=(1.2e-3, 1e-3))
    assert "it does not solve 25 % at 1e-03" in found.attrs["omissions"]


def test_no_more_cells_are_taken_than_are_wanted():
    study = build(axes={"height": np.linspace(1, 10, 100)}, outputs=["impact_speed"])
    cells = precision_cells(study, 20)["height"]
    assert len(cells) == chart(study, cells=20).attrs["cells"] == 20
    truth = np.sqrt(2 * G * cells) * (1 + 0.01 * np.arange(1, 21))
    found = at(chart(study, cells=20, truth={"impact_speed": truth}), "exact")
    errors = 1 - 1 / (1 + 0.01 * np.arange(1, 21))
    assert float(found.error_median) == pytest.approx(np.median(errors))


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"methods": ["exakt"]}, "did you mean exact"),
        *(({"methods": methods}, "methods") for methods in ([], object(), [["exact"]])),
        ({"methods": 3}, "no method 3"),
        ({"reference": "magic"}, "magic"),
        *(({"tolerances": tolerances}, "rtol") for tolerances in ([0.0], [np.nan], [np.inf], [], "1e-3", 2)),
        ({"cells": 0}, "cells"),
        ({"truth": {"impact_sped": [1.0] * 4}}, "impact_speed"),
        ({"truth": {"impact_speed": [1.0] * 3}}, r"\(4,\)"),
        *(({"truth": truth}, "truth") for truth in ({}, [1.0] * 4)),
        *(({"reference": name}, "reference") for name in (["exact"], np.ones(2))),
        *(({"note": note}, "note") for note in (None, dict)),
    ],
)
def test_mistakes_are_told(options, word):
    with pytest.raises(sweep.SweepError, match=word):
        chart(stones(), **options)


def test_a_reference_that_solves_nothing_is_told():
    with pytest.raises(sweep.SweepError, match="none of"):
        chart(stones(heights=-HEIGHTS))


def test_cells_at_which_a_kernel_dies_are_left_out():
    notes = []
    keys = {"tolerances": [1e-6], "isolate": True, "note": notes.append}
    found = sweep.work_precision(tall(16, "bad:DYING"), **keys)
    begun, *others = notes
    assert "cells: 16" in begun
    assert [("1 of 16" in note, "height=11" in note) for note in others] == [(True, True)]
    assert (found.attrs["cells"], float(found.ok.min())) == (15, 1.0)
    with pytest.raises(sweep.SweepError, match="failed"):
        sweep.work_precision(tall(5, "bad:HOPELESS"), **keys)
