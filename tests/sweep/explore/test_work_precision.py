"""Errors and times of methods on the same cells: what is right, what is silently wrong, what fails, and who says so."""

from dataclasses import replace

import numpy as np
import pytest
from running import tall
from toy import KERNEL, exact, rough
from toy_studies import build

import sweep
from kernels.interface import Field, Method, Status
from kernels.lanes.jit import COMPILED
from sweep import SweepError, cli
from sweep.cells.sample import sampled, with_method
from sweep.explore.work_precision import precision_cells, precision_text, work_precision
from sweep.show.charts import draw_precision, new_figure, style

HEIGHTS = np.array([1.0, 2.0, 5.0, 10.0])
SPEEDS = np.array([0.0, 1e-3, 0.1, 3.0])
G = 9.80665


@pytest.fixture(autouse=True)
def _once_is_enough(monkeypatch):
    """Nothing here asks how long a method takes, so that cells are not solved again and again."""
    monkeypatch.setattr("sweep.explore.work_precision.LEAST_SECONDS", 1e-4)


def stones(**keys):
    """Four stones; those thrown faster are further from `rough`."""
    keys = {"design": "zip", "axes": {"height": HEIGHTS, "v0": SPEEDS}, "outputs": ["impact_speed"], **keys}
    return build(**keys)


def off_by_rough(heights=HEIGHTS, speeds=SPEEDS):
    """Relative error of the impact speed without v0."""
    return 1 - np.sqrt(2 * G * heights) / np.hypot(speeds, np.sqrt(2 * G * heights))


def bad(share, status=Status.OK):
    """As `exact`, but in cells with height 10 off by a share, or refused."""

    def solve(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said):
        exact(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said)
        here = height == 10.0
        impact_speed[here] *= 1 + share
        said[here] = status

    return solve


def with_methods(study, *methods, outputs=KERNEL.outputs):
    return replace(study, kernel=replace(KERNEL, methods=methods, outputs=outputs))


def measured(study, **options):
    return work_precision(study, **{"tolerances": [1e-3, 1e-6], **options})


def at(found, method, rtol=1e-6):
    return found.sel({"method": method, "rtol": rtol})


def test_errors_are_those_against_the_truth():
    found = measured(stones(), reference="exact")
    cell = at(found, "rough")
    # of cells said to be right to 1e-6 the worst is the second: its bound v0^2/(4 g h) is 1.3e-8
    assert float(cell.error_worst) == pytest.approx(off_by_rough()[1], rel=1e-6)
    assert float(cell.error_median) == pytest.approx(np.median(off_by_rough()), rel=1e-9)
    assert cell.worst_cell.item() == "height=2 v0=0.001"
    assert [float(cell[key]) for key in ("ok", "inaccurate", "unsolved", "silent")] == [0.5, 0.5, 0.0, 0.0]
    assert float(at(found, "exact").error_worst) == found.attrs["reference_error"]


def test_auto_is_measured_beside_the_methods_and_says_which_it_took():
    found = measured(stones())
    assert list(found.method.values) == ["auto", "rough", "exact"]
    assert at(found, "auto").methods_used.item() == "rough 50 %, exact 50 %"
    assert float(at(found, "auto").ok) == 1
    assert (found.seconds > 0).all()


def test_the_method_and_tolerances_of_the_study_are_left_aside():
    plain = measured(stones())
    other = measured(stones(method="rough", rtol=0.5))
    swept = build(outputs=["impact_speed"], axes={"method": ["rough", "exact"]}, fixed={"height": 1.0})
    assert plain.drop_vars("seconds").identical(other.drop_vars("seconds"))
    assert list(measured(swept).method.values) == ["auto", "rough", "exact"]


def test_a_cell_that_is_wrong_and_called_right_is_found():
    study = with_methods(stones(), Method("liar", "", bad(1e-5)), Method("exact", "", exact))
    found = measured(study, reference="exact")
    assert float(at(found, "liar").silent) == 0.25
    assert float(at(found, "liar", 1e-3).silent) == 0  # off by less than is wanted
    assert at(found, "liar").silent_at.item() == "height=10 v0=3"
    assert "liar is silently wrong in 25 % at 1e-06, first height=10 v0=3" in found.attrs["omissions"]
    assert float(at(found, "liar").error_worst) == pytest.approx(1e-5, rel=1e-6)


@pytest.mark.parametrize(("share", "silent"), [(0.9e-6, 0.0), (1.1e-6, 0.25)])
def test_the_border_of_silently_wrong_is_rtol(share, silent):
    study = with_methods(stones(), Method("liar", "", bad(share)), Method("exact", "", exact))
    assert float(at(measured(study, reference="exact"), "liar").silent) == silent


def test_no_value_in_a_cell_called_right_has_failed_and_is_told():
    study = with_methods(stones(), Method("liar", "", bad(np.nan)), Method("exact", "", exact))
    found = measured(study, reference="exact")
    assert float(at(found, "liar").silent) == 0
    assert "liar does not solve 25 % at 1e-03, 25 % at 1e-06, first FAILED" in found.attrs["omissions"]


def test_what_a_method_says_of_itself_is_not_silent():
    for status in (Status.INACCURATE, Status.GRAZING):
        study = with_methods(stones(), Method("modest", "", bad(1.0, status)), Method("exact", "", exact))
        cell = at(measured(study, reference="exact"), "modest")
        assert float(cell.silent) == 0
        assert float(cell.error_worst) == 0
        assert float(cell.inaccurate) == (0.25 if status == Status.INACCURATE else 0)
        assert float(cell.remarked) == (0.25 if status == Status.GRAZING else 0)


def test_unsolved_cells_are_counted_and_named():
    study = with_methods(stones(), Method("weak", "", bad(0, Status.STEP_LIMIT)), Method("exact", "", exact))
    found = measured(study, reference="exact")
    assert float(at(found, "weak").unsolved) == 0.25
    assert at(found, "weak").unsolved_as.item() == "STEP_LIMIT at height=10 v0=3"
    assert (
        "weak does not solve 25 % at 1e-03, 25 % at 1e-06, first STEP_LIMIT at height=10 v0=3"
        in found.attrs["omissions"]
    )
    assert float(at(found, "auto").unsolved) == 0  # it went on to exact


def test_a_value_where_there_is_nothing_to_give_is_silently_wrong():
    sure = Method("sure", "", bad(0, Status.NEVER_STARTS))
    study = with_methods(stones(), Method("exact", "", exact), sure)
    assert float(at(measured(study, reference="sure"), "exact").silent) == 0.25
    weak = with_methods(stones(), Method("exact", "", exact), Method("weak", "", bad(0, Status.NOT_CONVERGED)))
    found = measured(weak, reference="weak")  # to give up is to say nothing
    assert float(at(found, "exact").silent) == 0
    assert (found.attrs["cells"], found.attrs["open_cells"]) == (3, 1)


def test_cells_that_check_refuses_are_judged_by_their_refusal():
    found = measured(stones(axes={"height": HEIGHTS, "v0": [0.0, -1.0, np.nan, 1.0]}))
    assert found.attrs["cells"] == 4
    assert float(found.silent.max()) == 0
    assert float(at(found, "exact").ok) == 0.5


def test_methods_that_cannot_do_the_study_are_named_as_omitted():
    narrow = Method("narrow", "", rough, excludes=("v0",), lacks=("drop",))
    study = with_methods(stones(), narrow, Method("exact", "", exact))
    assert measured(study).attrs["omissions"] == "narrow cannot do v0"
    still = with_methods(
        build(outputs=["drop"], axes={"height": HEIGHTS}, along={"phase": {"num": 3}}), *study.kernel.methods
    )
    assert measured(still).attrs["omissions"] == "narrow does not give drop"
    assert measured(still).method.values.tolist() == ["auto", "exact"]


def test_nothing_is_omitted_where_nothing_fails():
    assert measured(stones()).attrs["omissions"] == ""


def test_the_reference_is_the_method_that_leaves_no_cell_open():
    found = measured(stones())
    assert found.attrs["reference"] == "exact"
    assert found.attrs["reference_error"] == 1e-14
    assert found.attrs["open_cells"] == 0


def test_of_methods_that_solve_all_cells_one_that_states_a_bound_is_the_reference():
    still = stones(axes={"height": HEIGHTS, "v0": np.zeros(4)})
    assert measured(still).attrs["reference"] == "rough"


def test_methods_that_state_no_bound_are_not_tried_where_another_leaves_no_cell_open():
    calls = []

    def dear(*columns):
        calls.append(columns[3][0])
        exact(*columns)

    still = stones(axes={"height": HEIGHTS, "v0": np.zeros(4)})
    study = with_methods(still, Method("dear", "", dear), KERNEL.methods[0])
    found = work_precision(study, methods=["rough"], tolerances=[1e-3])
    assert found.attrs["reference"] == "rough"
    assert calls == []


def test_the_floor_is_the_least_rtol_at_which_the_reference_says_ok():
    def coarse(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        exact(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status)
        impact_speed *= 1 + rtol / 2
        status[rtol < 1e-9 * (1 - 1e-9)] = Status.INACCURATE

    study = with_methods(stones(), Method("exact", "", exact), Method("coarse", "", coarse))
    found = work_precision(study, reference="coarse", tolerances=[1e-12])
    assert found.attrs["reference_error"] == pytest.approx(1e-9)
    assert float(at(found, "exact", 1e-12).error_worst) == pytest.approx(0.5e-9, rel=1e-3)
    assert float(at(found, "exact", 1e-12).silent) == 0  # the truth is no better than that


def test_given_truth_is_taken_as_it_is():
    study = stones()
    cells = precision_cells(study)
    np.testing.assert_array_equal(cells["height"], HEIGHTS)
    true = np.hypot(cells["v0"], np.sqrt(2 * G * cells["height"]))
    found = measured(study, truth={"impact_speed": true * [1, 1, 1, 1.01]})
    assert found.attrs["reference"] == "the truth given"
    assert float(at(found, "exact").error_worst) == pytest.approx(0.01 / 1.01)
    assert float(at(found, "exact").silent) == 0.25


def test_given_truth_without_a_value_refuses_the_cell():
    true = np.hypot(SPEEDS, np.sqrt(2 * G * HEIGHTS))
    found = measured(stones(), truth={"impact_speed": [*true[:3], np.nan]})
    assert float(at(found, "exact").silent) == 0.25
    assert at(found, "exact").silent_at.item() == "height=10 v0=3"


def test_relative_errors_are_infinite_where_the_truth_is_zero():
    true = np.hypot(SPEEDS, np.sqrt(2 * G * HEIGHTS))
    found = at(measured(stones(), truth={"impact_speed": true * [1, 0, 0, 0]}), "exact")
    assert float(found.error_low) < 1e-9
    assert np.isinf([found.error_median, found.error_high, found.error_worst]).all()


def test_traces_are_compared_relative_to_their_largest_value():
    study = build(outputs=["drop"], axes={"height": [2.0]}, along={"phase": {"values": [0.5, 1.0]}})
    found = measured(study, truth={"drop": [[0.5, 2.0 + 1e-4]]})
    assert float(at(found, "exact").error_worst) == pytest.approx(0.5e-4, rel=1e-3)
    other = measured(study, truth={"drop": [[0.5 + 1e-4, 2.0]]})
    assert float(at(other, "exact").error_worst) == pytest.approx(0.5e-4, rel=1e-3)


def test_counts_of_work_are_means_beside_the_time_and_no_error():
    def counted(height, v0, g, rtol, phase, fall_time, impact_speed, drop, steps, status):
        exact(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status)
        steps[:] = -np.log10(rtol) + (height == 10.0)

    outputs = (*KERNEL.outputs, Field("steps", "1", "steps taken", integer=True))
    kernel = replace(KERNEL, methods=(Method("counted", "", counted),), outputs=outputs)
    study = replace(stones(), kernel=kernel, outputs=("impact_speed", "steps"))
    found = measured(study)
    assert found.steps.sel({"method": "counted"}).values == pytest.approx([3.25, 6.25])
    assert float(found.error_worst.max()) == found.attrs["reference_error"]
    assert "  steps  " in precision_text(found, complete=True)


def test_no_more_cells_are_taken_than_are_wanted():
    study = build(axes={"height": np.linspace(1, 10, 100)})
    assert measured(study, cells=7).attrs["cells"] == 7
    assert len(precision_cells(study, 7)["height"]) == 7
    assert sampled(study, 7).axes["height"].values.tolist() == precision_cells(study, 7)["height"].tolist()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"methods": ["exakt"]}, "no method exakt that can do this study; did you mean exact?"),
        ({"methods": ["magic"]}, "there are auto, rough, exact"),
        ({"reference": "magic"}, "no method magic"),
        ({"tolerances": [0.0]}, "numbers above 0"),
        ({"tolerances": [np.nan]}, "numbers above 0"),
        ({"tolerances": []}, "numbers above 0"),
        ({"cells": 0}, "cells: expected at least 1"),
        ({"truth": {"impact_sped": [1.0] * 4}}, "did you mean impact_speed?"),
        ({"truth": {"impact_speed": [1.0] * 3}}, r"shape \(3,\), its cells \(4,\)"),
        ({"truth": {}}, "no output is given"),
    ],
)
def test_mistakes_are_told(options, said):
    with pytest.raises(SweepError, match=said):
        measured(stones(), **options)


def test_a_reference_that_solves_nothing_is_told():
    with pytest.raises(SweepError, match="solves none of the cells"):
        measured(stones(axes={"height": -HEIGHTS, "v0": SPEEDS}))


def test_a_study_that_no_method_can_do_is_told():
    study = with_methods(stones(), Method("narrow", "", rough, excludes=("v0",)))
    with pytest.raises(SweepError, match="no method of the kernel can do this study"):
        measured(study)


def test_the_table_tells_errors_shares_and_what_they_are_measured_against():
    text = precision_text(measured(stones()))
    lines = text.splitlines()
    assert lines[0].split()[3:] == ["worst", "time", "ok", "unsolved", "silent"]
    assert any(line.split()[:2] == ["rough", "1e-06"] and "50 %" in line for line in lines)
    assert "errors against exact, in 4 cells, itself right to 1.0e-14" in text
    assert all("reference" in line for line in lines if line.split()[:1] == ["exact"])
    assert "Omissions" not in text


def test_a_tolerance_given_twice_is_measured_once():
    assert measured(stones(), tolerances=[1e-3, 1e-3, 1e-6]).rtol.values.tolist() == [1e-3, 1e-6]


def test_with_method_is_the_study_but_for_the_method():
    study = stones()
    assert with_method(study, "rough", 0.1).axes is study.axes


def test_the_picture_has_a_line_for_each_method_open_marks_where_cells_fail_and_crosses_where_they_lie(tmp_path):
    study = with_methods(
        stones(),
        Method("liar", "", bad(1e-5)),
        Method("weak", "", bad(0, Status.STEP_LIMIT)),
        Method("exact", "", exact),
    )
    found = measured(study, reference="exact")
    figure = sweep.plot(found, tmp_path / "chart.png")
    median, worst = figure.axes
    assert (median.get_xscale(), worst.get_yscale()) == ("log", "log")
    lines = {line.get_label(): line for line in worst.lines}
    assert set(found.method.values) <= set(lines)
    np.testing.assert_allclose(lines["liar"].get_ydata(), found.error_worst.sel({"method": "liar"}))
    crosses = [line for line in worst.lines if line.get_marker() == "x" and len(line.get_xdata())]
    assert len(crosses) == 2  # liar, and auto which believed it
    open_marks = [line for line in worst.lines if line.get_markerfacecolor() == "white" and len(line.get_xdata())]
    assert len(open_marks) == 1
    assert (lines["exact"].get_ydata() == found.attrs["reference_error"]).all()
    assert (tmp_path / "chart.png").read_bytes().startswith(b"\x89PNG")


def test_cells_that_the_reference_has_solved_itself_are_at_what_it_is_right_to():
    found = measured(stones(), tolerances=[1e-9])
    reference = found.attrs["reference"]
    assert reference in str(found.methods_used.sel({"method": "auto"}).item())
    for name in ("auto", reference):
        worst = float(found.error_worst.sel({"method": name}).item())
        assert worst >= found.attrs["reference_error"] > 0, name


def idle(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said):
    """Refuses every cell."""
    for column in (fall_time, impact_speed, drop):
        column[...] = np.nan
    said[:] = Status.STEP_LIMIT


def test_neither_notes_nor_legend_lie_over_anything(tmp_path):
    study = with_methods(
        stones(), *(Method(f"method_{k}", "", bad(1e-5 if k else 0, Status.STEP_LIMIT)) for k in range(9))
    )
    others = Method("liar", "", bad(1e-5)), Method("idle", "", idle), Method("exact", "", exact)
    study = with_methods(study, *study.kernel.methods, *others)
    figure = sweep.plot(measured(study, reference="exact"))
    with style():
        figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    for said in ("all cells solved", "some unsolved or inaccurate", "some silently wrong", "below what the reference"):
        assert any(text.startswith(said) for text in texts), said
    note = next(text for text in figure.texts if text.get_text().startswith("Errors against exact, itself right to"))
    said = note.get_text().replace("\n", " ")
    assert "idle solves no cell" in said
    assert "liar is silently wrong" in said
    assert "liar" in texts
    assert "idle" not in texts
    boxes = [thing.get_window_extent(renderer) for thing in (legend, note)]
    boxes += [axes.get_tightbbox(renderer) for axes in figure.axes[:1]]
    for i, one in enumerate(boxes):
        assert figure.bbox.y0 <= one.y0 < one.y1 <= figure.bbox.y1
        assert not any(one.overlaps(other) for other in boxes[:i])


def test_a_method_looks_the_same_in_pictures_that_name_the_same_methods():
    found = measured(stones())
    with style():
        left, right = new_figure(100, 60).subplots(1, 2)
        draw_precision(left, found, "error_worst", ["exact", "rough"])
        draw_precision(right, found.sel({"method": ["exact"]}), "error_worst", ["exact", "rough"])
    looks = [{line.get_label(): (line.get_color(), line.get_marker()) for line in axes.lines} for axes in (left, right)]
    assert looks[0]["exact"] == looks[1]["exact"] != looks[0]["rough"]


@pytest.mark.skipif(not COMPILED, reason="hundreds of steps; the kernel's own tests run as plain Python")
def test_what_a_method_estimates_of_its_own_error_is_not_compared():
    fixed = {"phi0": 1.0, "a": 0.5, "flips": 2, "step": 0.05}
    found = work_precision(
        {"kernel": "foliot_steps", "axes": {"mu": [0.5, 5.0]}, "fixed": fixed},
        methods=["dopri5", "dop853"],
        tolerances=[1e-9],
    )
    assert not found.silent.any()
    assert float(found.error_worst.max()) < 1e-9
    assert (found.error_low <= found.error_median).all()
    assert (found.error_median <= found.error_high).all()


TOML = """# How right is a stone?
kernel = "toy:KERNEL"
outputs = ["impact_speed"]
[axes.v0]
spacing = "log"
start = 1e-3
stop = 1
num = 9
[fixed]
height = 1.0
"""


@pytest.fixture
def chart(tmp_path, monkeypatch, capsys):
    """Runs `sweep chart` on a study of nine cells: exit status, printed, complained."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stone.toml").write_text(TOML)

    def chart(*options):
        code = cli.main(["chart", "stone.toml", "--allow-import", *options])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return chart


def test_the_command_prints_the_table_and_draws_the_chart(chart, tmp_path):
    code, out, _ = chart()
    assert code == 0
    assert out.splitlines()[-1] == "stone_chart.png"
    assert (tmp_path / "stone_chart.png").exists()
    assert [line.split()[1] for line in out.splitlines() if line.split()[:1] == ["rough"]] == [
        "1e-03", "1e-05", "1e-07", "1e-09", "1e-11", "1e-13",
    ]  # fmt: skip


def test_the_command_takes_methods_tolerances_cells_and_a_reference(chart, tmp_path):
    options = ("--methods", "rough", "--rtol", "1e-2", "1e-4", "--cells", "5", "--reference", "exact", "-o", "a.svg")
    code, out, _ = chart(*options)
    assert code == 0
    assert (tmp_path / "a.svg").exists()
    assert [line.split()[:2] for line in out.splitlines()[1:3]] == [["rough", "1e-02"], ["rough", "1e-04"]]
    assert "in 5 cells" in out


@pytest.mark.parametrize(
    "options", [("--methods", "none"), ("--rtol", "-1"), ("--cells", "0"), ("--reference", "none"), ("-o", "a.txt")]
)
def test_mistakes_on_the_command_line_are_one_message(chart, options):
    code, _, err = chart(*options)
    assert code == 2
    assert err.strip()
    assert "Traceback" not in err


def test_cells_at_which_a_kernel_dies_are_left_out_of_a_chart():
    told = []
    keys = {"tolerances": [1e-6], "isolate": True, "note": told.append}
    found = work_precision(tall(40, "bad:DYING"), **keys)
    assert told == ["the kernel fails at 3 of 40 cells, e.g. height=11; they are left out"]
    assert (found.attrs["cells"], float(found.ok.min())) == (37, 1.0)
    with pytest.raises(SweepError, match="the kernel failed"):
        work_precision(tall(5, "bad:HOPELESS"), **keys)


def test_every_variable_says_what_it_is_and_the_attributes_what_was_measured():
    found = measured(stones(title="Stones"), reference="exact", methods=["rough"])
    assert found.attrs["title"] == "Stones"
    assert (found.attrs["kernel"], found.attrs["missing"]) == ("toy:KERNEL", "")
    assert {name for name in found.data_vars if found[name].attrs["units"] == "s"} == {"seconds"}
    assert found.ok.attrs == {"units": "1", "long_name": "share of cells that the method calls right"}
    assert all(found[name].attrs["long_name"] for name in found.data_vars)
    weak = with_methods(stones(), Method("weak", "", bad(0, Status.NOT_CONVERGED)))
    assert measured(weak).attrs["open_cells"] == 1
