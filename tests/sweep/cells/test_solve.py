"""Which method a cell gets, and what is said of it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stand_ins import solved, stand_in, toy_study, with_kernel
from toy import KERNEL

import sweep
from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.block import warm
from sweep.cells.grid import Cells, Grid
from sweep.cells.solve import NONE, STRIP, UNKNOWN, Solver, among
from sweep.cells.turns import usable_methods
from sweep.results.statuses import account

NAMES = [m.name for m in KERNEL.methods]


def test_auto_takes_the_cheapest_method_whose_bound_meets_rtol():
    speeds = np.array([0.0, 1e-4, 1e-3, 1e-1, 1.0])
    study = toy_study(axes={"v0": speeds}, fixed={"height": 1.0}, rtol=1e-6)
    outputs, status, used = solved(study)
    bound = speeds**2 / (4 * 9.80665) + 1e-15
    assert [NAMES[u] for u in used] == ["rough" if b <= 1e-6 else "exact" for b in bound]
    assert (status == Status.OK).all()
    assert outputs["impact_speed"] == pytest.approx(np.hypot(speeds, np.sqrt(2 * 9.80665)), rel=1e-6)


def test_only_the_outputs_asked_for_decide():
    axes, fixed = {"v0": np.array([1e-3])}, {"height": 1.0}
    speed = solved(toy_study(axes=axes, fixed=fixed, rtol=1e-6, outputs=["impact_speed"]))
    both = solved(toy_study(axes=axes, fixed=fixed, rtol=1e-6, outputs=["impact_speed", "fall_time"]))
    assert NAMES[speed[2][0]] == "rough"
    assert NAMES[both[2][0]] == "exact"


def test_a_method_that_was_asked_for_is_kept_and_its_loose_cells_are_remarked():
    study = toy_study(axes={"v0": np.array([0.0, 1.0])}, fixed={"height": 1.0}, method="rough", rtol=1e-6)
    outputs, status, used = solved(study)
    assert status.tolist() == [Status.OK, Status.INACCURATE]
    assert used.tolist() == [0, 0]
    assert np.isfinite(outputs["impact_speed"]).all()


def test_refused_cells_are_nan_without_a_method_and_the_others_are_solved():
    study = toy_study(
        axes={"height": np.array([1.0, -1.0, np.nan, 2.0, np.inf])}, outputs=["impact_speed", "fall_time"]
    )
    outputs, status, used = solved(study)
    assert status.tolist() == [Status.OK, Status.BAD_INPUT, Status.BAD_INPUT, Status.OK, Status.BAD_INPUT]
    for column in outputs.values():
        assert np.isnan(column).tolist() == [False, True, True, False, True]
    assert used.tolist() == [0, NONE, NONE, 0, NONE]


def test_a_trace_is_nan_all_along_where_its_cell_is_refused():
    study = toy_study(axes={"height": [1.0, -1.0]}, outputs=["drop"], along={"phase": [0.0, 0.5, 1.0]})
    outputs, _, _ = solved(study)
    assert outputs["drop"][0].tolist() == [0.0, 0.25, 1.0]
    assert np.isnan(outputs["drop"][1]).all()


@pytest.mark.parametrize("verdict", [Status.NOT_CONVERGED, Status.STEP_LIMIT])
def test_auto_goes_on_where_a_method_gives_up(verdict):
    def gives_up(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...] = 1.0, 1.0, 1.0
        status[...] = np.where(height > 1.5, verdict, Status.OK)

    study = toy_study(axes={"height": np.array([1.0, 2.0, 1.2, 3.0])})
    outputs, status, used = solved(with_kernel(study, stand_in(rough=(gives_up, None))))
    assert used.tolist() == [0, 1, 0, 1]
    assert (status == Status.OK).all()
    assert outputs["impact_speed"] == pytest.approx([1.0, np.sqrt(4 * 9.80665), 1.0, np.sqrt(6 * 9.80665)])


def test_auto_goes_on_where_a_method_gives_up_that_is_promised_for_some_cells_alone():
    def gives_up(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...] = 1.0, 1.0, 1.0
        status[...] = np.where(height > 2.5, Status.NOT_CONVERGED, Status.OK)

    def odd(height, v0, g, rtol, phase, asked, out):
        out[...] = np.where(height % 2.0 == 1.0, 0.0, np.inf)

    study = toy_study(axes={"height": np.array([1.0, 2.0, 3.0, 4.0])})
    outputs, status, used = solved(with_kernel(study, stand_in(rough=(gives_up, odd))))
    assert used.tolist() == [0, 1, 1, 1]
    assert (status == Status.OK).all()
    assert outputs["impact_speed"] == pytest.approx([1.0, *np.sqrt(2 * 9.80665 * np.array([2.0, 3.0, 4.0]))])


def test_cells_that_do_not_lie_side_by_side_keep_their_own_rtol():
    def tells_rtol(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...], status[...] = 1.0, rtol, 1.0, Status.OK

    def coarse(height, v0, g, rtol, phase, asked, out):
        out[...] = np.where(rtol >= 1e-6, 0.0, np.inf)

    wanted = [1e-3, 1e-12, 1e-6, 1e-9]
    study = toy_study(axes={"rtol": wanted}, fixed={"v0": 0.0, "height": 1.0})
    outputs, _, used = solved(with_kernel(study, stand_in(rough=(tells_rtol, coarse), exact=(tells_rtol, None))))
    assert used.tolist() == [0, 1, 0, 1]
    assert outputs["impact_speed"].tolist() == wanted


def test_auto_keeps_inaccurate_values_that_no_later_method_betters():
    def loose(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...] = 1.0, height, 1.0
        status[...] = Status.INACCURATE

    def refuses(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...] = 2.0, 2.0, 2.0
        status[...] = np.where(height > 1.5, np.where(height > 2.5, Status.INACCURATE, Status.STICKS), Status.OK)

    study = toy_study(axes={"height": np.array([1.0, 2.0, 1.2, 3.0])})
    kernel = stand_in(rough=(loose, None), exact=(refuses, None))
    outputs, status, used = solved(with_kernel(study, kernel))
    assert used.tolist() == [1, 0, 1, 0]
    assert status.tolist() == [Status.OK, Status.INACCURATE, Status.OK, Status.INACCURATE]
    assert outputs["impact_speed"].tolist() == [2.0, 2.0, 2.0, 3.0]


def test_auto_does_not_go_on_where_the_result_itself_is_out_of_range():
    def too_large(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        status[...] = Status.OUT_OF_RANGE

    study = toy_study(axes={"height": [1.0, 2.0]})
    _, status, used = solved(with_kernel(study, stand_in(rough=(too_large, None))))
    assert (status == Status.OUT_OF_RANGE).all()
    assert (used == NONE).all()


@pytest.mark.parametrize("method", ["auto", "rough"])
def test_a_bound_that_equals_rtol_meets_it(method):
    def just(height, v0, g, rtol, phase, asked, out):
        out[...] = 1e-6

    kernel = stand_in(rough=(KERNEL.methods[0].solve, just))
    study = toy_study(axes={"height": [1.0, 2.0]}, method=method, rtol=1e-6)
    _, status, used = solved(with_kernel(study, kernel))
    assert status.tolist() == [Status.OK, Status.OK]
    assert used.tolist() == [0, 0]


def test_a_method_that_gives_up_is_not_said_to_be_merely_inaccurate():
    def gives_up(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...] = 1.0, 1.0, 1.0
        status[...] = Status.NOT_CONVERGED

    study = toy_study(axes={"v0": [1.0, 2.0]}, fixed={"height": 1.0}, method="rough", rtol=1e-6)
    outputs, status, used = solved(with_kernel(study, stand_in(rough=(gives_up, KERNEL.methods[0].bound))))
    assert (status == Status.NOT_CONVERGED).all()
    assert (used == NONE).all()
    assert np.isnan(outputs["impact_speed"]).all()


def test_a_cell_that_no_method_promises_is_refused():
    def never(height, v0, g, rtol, phase, asked, out):
        out[...] = np.inf

    kernel = stand_in(rough=(KERNEL.methods[0].solve, never), exact=(KERNEL.methods[1].solve, never))
    outputs, status, used = solved(with_kernel(toy_study(axes={"height": [1.0, 2.0]}), kernel))
    assert (status == Status.NO_METHOD).all()
    assert (used == NONE).all()
    assert np.isnan(outputs["impact_speed"]).all()


def test_the_last_refusal_is_told_where_every_method_gives_up():
    def gives_up(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        status[...] = Status.STEP_LIMIT

    kernel = stand_in(rough=(gives_up, None), exact=(gives_up, None))
    _, status, used = solved(with_kernel(toy_study(axes={"height": [1.0, 2.0]}), kernel))
    assert (status == Status.STEP_LIMIT).all()
    assert (used == NONE).all()


def test_method_and_rtol_as_axes_are_settings_of_each_cell():
    study = toy_study(
        axes={"method": ["exact", "auto", "rough"], "rtol": [1e-2, 1e-9], "v0": [0.0, 0.1]}, fixed={"height": 1.0}
    )
    _, status, used = solved(study)
    assert used.reshape(3, 2, 2).tolist() == [[[1, 1], [1, 1]], [[0, 0], [0, 1]], [[0, 0], [0, 0]]]
    assert status.reshape(3, 2, 2)[2].tolist() == [[0, 0], [0, Status.INACCURATE]]


def test_refused_cells_stay_refused_on_a_method_axis():
    _, status, used = solved(toy_study(axes={"method": ["exact", "auto", "rough"], "height": [1.0, -1.0, 2.0]}))
    assert status.reshape(3, 3).tolist() == [[Status.OK, Status.BAD_INPUT, Status.OK]] * 3
    assert used.reshape(3, 3).tolist() == [[1, NONE, 1], [0, NONE, 0], [0, NONE, 0]]


def test_methods_are_told_apart_behind_a_refused_cell():
    study = toy_study(axes={"v0": [-1.0, 1e-6, 1.0, 2e-6, 2.0]}, fixed={"height": 1.0}, rtol=1e-6)
    outputs, status, used = solved(study)
    assert status.tolist() == [Status.BAD_INPUT] + [Status.OK] * 4
    assert used.tolist() == [NONE, 0, 1, 0, 1]
    assert outputs["impact_speed"][1:] == pytest.approx(np.sqrt(2 * 9.80665 + np.array([0.0, 1.0, 0.0, 4.0])))


def test_a_parameter_that_follows_an_axis_runs_along_with_it():
    study = replace(toy_study(axes={"height": [1.0, 2.0, 5.0]}), fixed={"v0": 0.0}, follows={"g": "height"})
    columns = [np.full(2, -1.0) for _ in KERNEL.parameters]
    Grid(study).columns(1, 3, columns)
    assert [column.tolist() for column in columns] == [[2.0, 5.0], [-1.0, -1.0], [2.0, 5.0]]


def test_a_term_that_a_method_excludes_keeps_auto_from_it():
    rough = replace(KERNEL.methods[0], excludes=("v0",))
    kernel = replace(KERNEL, methods=(rough, KERNEL.methods[1]))
    plain = with_kernel(toy_study(axes={"height": [1.0]}), kernel)
    thrown = with_kernel(toy_study(axes={"height": [1.0]}, fixed={"v0": 1e-9}), kernel)
    assert usable_methods(plain) == (0, 1)
    assert usable_methods(thrown) == (1,)
    assert solved(thrown)[2].tolist() == [1]


FOLIOT = sweep.build_study(
    kernel="foliot",
    axes={"mu": np.concatenate([np.geomspace(1e-6, 1e6, 90), [-1.0, np.nan, 0.0]]), "a": [1.0, 0.0, 1e-3, 30.0]},
    fixed={"phi0": 0.5},
    rtol=1e-6,
)


@pytest.fixture(scope="module")
def whole():
    return solved(FOLIOT)


@given(st.integers(0, 372), st.integers(0, 372))
def test_any_range_of_cells_gives_the_same_bits(whole, one, other):
    start, stop = sorted((one, other))
    outputs, status, used = solved(FOLIOT, start, stop)
    for name, column in outputs.items():
        assert np.array_equal(column, whole[0][name][start:stop], equal_nan=True)
    assert np.array_equal(status, whole[1][start:stop])
    assert np.array_equal(used, whole[2][start:stop])


def test_auto_takes_the_closed_form_of_the_foliot_outright(whole):
    names = [m.name for m in FOLIOT.kernel.methods]
    assert {names[u] for u in whole[2].reshape(93, 4)[:90, 0]} == {"closed"}
    assert set(whole[1].reshape(93, 4)[90]) == {Status.BAD_INPUT}
    assert whole[1].reshape(93, 4)[92].tolist() == [Status.NEVER_STARTS] * 4
    assert whole[1].reshape(93, 4)[0, 1] == Status.NO_LIMIT_CYCLE


def test_strips_join_without_a_seam():
    mu = np.geomspace(1e-3, 1e3, STRIP + 100)
    study = sweep.build_study(kernel="foliot", axes={"mu": mu}, fixed={"a": 1.0, "phi0": 1.0}, method="closed")
    outputs, status, _ = solved(study)
    seam, _, _ = solved(study, STRIP - 50, STRIP + 50)
    assert (status < FIRST_REFUSAL).all()
    assert np.array_equal(outputs["period"][STRIP - 50 : STRIP + 50], seam["period"])
    assert np.all(np.diff(outputs["period"]) < 0)


@pytest.mark.parametrize("strip", [1, 7, 8, 20, 21, 22])
def test_strips_of_any_length_give_the_same_cells(monkeypatch, strip):
    monkeypatch.setattr("sweep.cells.solve.STRIP", strip)
    heights = np.arange(1.0, 22.0)
    outputs, status, used = solved(toy_study(axes={"height": heights}), 1, 21)
    assert outputs["impact_speed"].tolist() == np.sqrt(2 * 9.80665 * heights[1:]).tolist()
    assert (status == Status.OK).all()
    assert (used == 0).all()


def test_warming_up_reaches_both_ends_of_the_grid():
    seen = []

    def watched(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        seen.extend(height.tolist())
        status[...] = Status.OK

    study = toy_study(axes={"height": np.arange(1.0, 101.0)})
    watched_study = with_kernel(study, stand_in(rough=(watched, None)))
    warm(Solver(watched_study), watched_study)
    assert seen == [50.0, 1.0, 100.0]


def test_warming_up_changes_nothing(whole):
    solver = Solver(FOLIOT)
    warm(solver, FOLIOT)
    outputs = {name: np.empty(372) for name in FOLIOT.outputs}
    status, used = np.empty(372, np.int8), np.empty(372, np.int8)
    solver.solve(0, Cells(outputs, status, used))
    assert np.array_equal(outputs["period"], whole[0]["period"], equal_nan=True)


def test_auto_does_not_keep_an_inaccurate_value_while_a_method_is_left():
    def loose(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...] = 1.0, 1.0, 1.0
        status[...] = Status.INACCURATE

    study = toy_study(axes={"height": [1.0, 2.0]})
    _, status, used = solved(with_kernel(study, stand_in(rough=(loose, None))))
    assert used.tolist() == [1, 1]
    assert (status == Status.OK).all()
    only = stand_in(rough=(loose, None), exact=(loose, None))
    assert solved(with_kernel(study, only))[1].tolist() == [Status.INACCURATE] * 2


def test_a_bound_that_is_no_number_promises_nothing():
    def no_number(height, v0, g, rtol, phase, asked, out):
        out[...] = np.nan

    kernel = stand_in(rough=(KERNEL.methods[0].solve, no_number))
    study = toy_study(axes={"height": [1.0, 2.0]})
    assert solved(with_kernel(study, kernel))[2].tolist() == [1, 1]
    asked = with_kernel(toy_study(axes={"height": [1.0, 2.0]}, method="rough"), kernel)
    assert solved(asked)[1].tolist() == [Status.INACCURATE] * 2


def test_traces_are_solved_a_few_cells_at_a_time():
    phase = np.linspace(0, 1, 100_000)
    study = toy_study(
        axes={"height": np.linspace(1, 2, 50)}, outputs=["drop", "fall_time"], along={"phase": phase}, method="exact"
    )
    assert Solver(study)._strip == 20
    outputs, _, _ = solved(study, 0, 45)
    assert outputs["drop"][44, -1] == pytest.approx(1 + 44 / 49, rel=1e-15)
    only = Solver(toy_study(axes={"height": [1.0, 2.0]}, outputs=["fall_time"]))
    assert only._strip == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda k: {"outputs": (*k.outputs, k.outputs[0])}, "fall_time more than once"),
        (lambda k: {"along": ()}, "phase, neither in"),
    ],
)
def test_a_kernel_that_no_result_could_hold_is_refused_at_once(monkeypatch, change, message):
    import toy

    monkeypatch.setattr(toy, "KERNEL", replace(KERNEL, **change(KERNEL)))
    with pytest.raises(sweep.SweepError, match=message):
        toy_study(axes={"height": [1.0]})


def test_auto_keeps_an_unstable_cycle_only_where_no_later_method_has_values():
    def cycle(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...] = 1.0, 1.0, 1.0
        status[...] = Status.UNSTABLE

    def motion(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...] = 2.0, 2.0, 2.0
        status[...] = np.where(
            height > 1.5, np.where(height > 2.5, Status.INACCURATE, Status.STEP_LIMIT), Status.PERIOD_2
        )

    study = toy_study(axes={"height": [1.0, 2.0, 3.0]})
    outputs, status, used = solved(with_kernel(study, stand_in(rough=(cycle, None), exact=(motion, None))))
    assert status.tolist() == [Status.PERIOD_2, Status.UNSTABLE, Status.INACCURATE]
    assert used.tolist() == [1, 0, 1]
    assert outputs["impact_speed"].tolist() == [2.0, 1.0, 2.0]


def said_in_turn(*statuses):
    """What `auto` says of one cell whose methods, cheapest first, say these."""

    def method(number, says):
        def solve(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
            fall_time[...], impact_speed[...], drop[...], status[...] = number, number, number, says

        return replace(KERNEL.methods[1], name=f"method_{number}", solve=solve)

    kernel = replace(KERNEL, methods=tuple(method(number, says) for number, says in enumerate(statuses)))
    outputs, status, used = solved(with_kernel(toy_study(axes={"height": [1.0]}), kernel))
    return status[0], used[0], outputs["impact_speed"][0]


@pytest.mark.parametrize("unknown", [Status.NO_METHOD, Status.NOT_CONVERGED, Status.STEP_LIMIT])
def test_a_method_that_knows_no_cycle_of_its_kind_does_not_answer_for_one_that_does_not_know(unknown):
    assert said_in_turn(Status.NO_CYCLE, unknown, Status.NO_CYCLE)[0] == unknown
    assert said_in_turn(unknown, Status.NO_CYCLE)[0] == unknown
    assert said_in_turn(Status.NO_CYCLE, Status.NO_CYCLE)[0] == Status.NO_CYCLE
    assert said_in_turn(unknown, Status.NO_CYCLE, Status.OK) == (Status.OK, 2, 2.0)


def test_an_unstable_cycle_does_not_replace_a_motion_that_is_known_loosely():
    assert said_in_turn(Status.UNSTABLE, Status.INACCURATE, Status.UNSTABLE) == (Status.INACCURATE, 1, 1.0)


def test_auto_does_not_deny_what_an_impact_clock_does_where_following_it_leaves_that_open():
    random = np.random.default_rng(11)
    near = 1 + 10.0 ** random.uniform(-12, -3, 60) * random.choice([-1, 1], 60)
    axes = {"I_c": 1e-5 * np.append(1 + 1e-9, near), "e": [0.6, 0.77]}
    fixed = {"torque": 0.01, "I_v": 1e-5, "r_c": 0.03, "r_v": 0.03, "teeth": 31, "h": 0.001}
    keys = {"kernel": "impact", "axes": axes, "fixed": fixed, "outputs": ["period"]}
    _, status, used = solved(sweep.build_study(**keys))
    _, followed, _ = solved(sweep.build_study(**keys, method="events"))
    closed = solved(sweep.build_study(**keys, method="closed"))[1]
    open_ = among(followed, UNKNOWN)
    assert (closed == Status.NO_CYCLE).all()
    assert open_[1]
    assert open_.sum() > 20
    assert (status == followed).all()
    assert (used == np.where(open_, NONE, 1)).all()


MISSING = [math.nan, math.inf, -math.inf]


def without_a_number(number, verdict=Status.OK):
    """A method that gives a cell of height 2 this in place of its speed, and this verdict."""

    def solve(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], drop[...], status[...] = 1.0, 1.0, Status.OK
        impact_speed[...] = np.where(height == 2.0, number, height)
        status[height == 2.0] = verdict

    return solve, None


@pytest.mark.parametrize("number", MISSING)
@pytest.mark.parametrize("method", ["rough", "exact"])
def test_ok_without_a_number_has_failed(number, method):
    study = toy_study(axes={"height": [1.0, 2.0, 3.0, -1.0]}, method=method)
    outputs, status, used = solved(with_kernel(study, stand_in(**{method: without_a_number(number)})))
    assert status.tolist() == [Status.OK, Status.FAILED, Status.OK, Status.BAD_INPUT]
    assert np.isnan(outputs["impact_speed"]).tolist() == [False, True, False, True]
    assert used[1] == NONE


@pytest.mark.parametrize("number", MISSING)
def test_only_outputs_asked_for_can_be_missed(number):
    study = toy_study(axes={"height": [1.0, 2.0]}, outputs=["fall_time"], method="rough")
    outputs, status, _ = solved(with_kernel(study, stand_in(rough=without_a_number(number))))
    assert (status == Status.OK).all()
    assert outputs["fall_time"].tolist() == [1.0, 1.0]


def test_an_output_that_need_not_exist_is_not_missed():
    from dataclasses import replace

    kernel = stand_in(rough=without_a_number(math.inf))
    fields = tuple(replace(f, gaps=f.name == "impact_speed") for f in kernel.outputs)
    study = toy_study(axes={"height": [1.0, 2.0]}, method="rough")
    outputs, status, _ = solved(with_kernel(study, replace(kernel, outputs=fields)))
    assert (status == Status.OK).all()
    assert outputs["impact_speed"].tolist() == [1.0, math.inf]


@pytest.mark.parametrize("verdict", [Status.COMES_TO_REST, Status.TOO_SHORT])
def test_a_remark_may_lack_a_number(verdict):
    study = toy_study(axes={"height": [1.0, 2.0]}, method="rough")
    _, status, _ = solved(with_kernel(study, stand_in(rough=without_a_number(math.nan, verdict))))
    assert status.tolist() == [Status.OK, verdict]


def test_a_refusal_is_told_and_not_called_a_failure():
    study = toy_study(axes={"height": [1.0, 2.0]}, method="rough")
    _, status, _ = solved(with_kernel(study, stand_in(rough=without_a_number(math.nan, Status.STICKS))))
    assert status.tolist() == [Status.OK, Status.STICKS]


@pytest.mark.parametrize("verdict", [-1, -128, Status.PENDING])
def test_what_no_kernel_may_say_has_failed(verdict):
    study = toy_study(axes={"height": [1.0, 2.0]}, method="rough")
    outputs, status, _ = solved(with_kernel(study, stand_in(rough=without_a_number(5.0, verdict))))
    assert status.tolist() == [Status.OK, Status.FAILED]
    assert np.isnan(outputs["impact_speed"]).tolist() == [False, True]


def test_a_check_that_says_what_it_may_not_has_failed():
    from dataclasses import replace

    def check(height, v0, g, status):
        status[...] = np.where(height == 2.0, Status.PENDING, np.where(height == 3.0, -7, Status.OK))

    study = toy_study(axes={"height": [1.0, 2.0, 3.0]})
    _, status, _ = solved(with_kernel(study, replace(KERNEL, check=check)))
    assert status.tolist() == [Status.OK, Status.FAILED, Status.FAILED]


def test_a_trace_with_a_hole_has_failed():
    def hole(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        fall_time[...], impact_speed[...], drop[...], status[...] = 1.0, 1.0, 1.0, Status.OK
        drop[height == 2.0, 1] = math.nan

    study = toy_study(axes={"height": [1.0, 2.0]}, outputs=["drop"], along={"phase": [0.0, 0.5, 1.0]}, method="rough")
    outputs, status, _ = solved(with_kernel(study, stand_in(rough=(hole, None))))
    assert status.tolist() == [Status.OK, Status.FAILED]
    assert np.isnan(outputs["drop"]).all(axis=1).tolist() == [False, True]


def test_auto_goes_on_where_a_method_fails():
    study = toy_study(axes={"height": [1.0, 2.0]})
    _, status, used = solved(with_kernel(study, stand_in(rough=without_a_number(math.nan))))
    assert status.tolist() == [Status.OK, Status.OK]
    assert used.tolist() == [0, 1]


def test_failures_are_in_the_account():
    study = toy_study(axes={"height": [1.0, 2.0, -1.0]}, method="rough")
    dataset = sweep.run(with_kernel(study, stand_in(rough=without_a_number(math.nan))), progress=False)
    assert str(account(dataset)) == "3 cells: 1 ok, 0 remarks, 1 refused, 1 failed, 0 pending"
