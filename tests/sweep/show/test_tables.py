"""What is printed of results and laws: tables, where a status occurs, what is picked, a log that is followed."""

import numpy as np
import pytest
import xarray as xr
from toy_studies import build

import sweep
from kernels.interface import Status
from sweep.results.statuses import summary_text
from sweep.show import text as report
from sweep.show.compare import comparison, comparison_text, write_comparison
from sweep.show.follow import LOOK_SECONDS, SILENT_SECONDS, follow, reasons
from sweep.show.laws import Laws, law_rows, laws, laws_text, pick, write_laws
from sweep.show.text import result_text
from sweep.system.errors import SweepError

NAMES = {"y": "period", "x": "mu"}
FIT = {
    "low": 1.0, "high": 12345.678, "exponent": -0.333333333, "exponent_low": -0.35, "exponent_high": -0.31, "fits": 1.0,
    "points": 31, "drift": 0.0123, "residual": 4.56e-5, "prefactor": 2.71828182,
}  # fmt: skip
SIDES = {"exponent": [-1.00000049, -0.3333333], "exponent_low": [-1.1, -0.34], "exponent_high": [-0.9, -0.33]}
BEND = {"crossover": 0.7654321, "crossover_low": 0.5, "crossover_high": 1.0, "width": 0.4567, "residual": 0.0987}


def fit(**values):
    return xr.Dataset(FIT | values, attrs=NAMES)


def bend(regimes=2.0, **values):
    columns = {name: ("law", column) for name, column in SIDES.items()} | BEND | {"regimes": regimes}
    return xr.Dataset(columns | values, {"law": ["low", "high"]}, NAMES)


def along(a, *parts):
    return xr.concat(parts, "a").assign_coords(a=a)


def found(*fits, bend=None, meeting=None, remark=""):
    return Laws("period", "mu", fits or (fit(),), bend, meeting, 0.9, remark)


def lines(text, section=0):
    return [" ".join(line.split()) for line in text.split("\n\n")[section].splitlines()]


def test_one_law_is_told_with_its_window_interval_and_misfit():
    heading = "window p interval points drift residual period at mu = 1"
    row = "1 to 1.235e+04 -0.33333333 -0.35 to -0.31 31 1.2e-02 4.6e-05 2.71828"
    assert lines(laws_text(found())) == ["period ~ mu^p", heading, row]
    (row,) = lines(laws_text(found(fit(fits=0.0))))[2:]
    assert row.startswith("1 to 1.235e+04 -0.33 runs from -0.35 to -0.31 31")


def test_two_laws_are_told_each_with_its_interval_and_where_they_meet():
    text = laws_text(found(bend=bend()))
    assert lines(text, 1)[2:] == [
        "-1 -1.1 to -0.9 -0.333333 -0.34 to -0.33 0.765432 0.5 to 1 0.46 decades wide, residual 9.9e-02"
    ]
    text = laws_text(found(along([1.0, 2.0], fit(), fit()), bend=along([1.0, 2.0], bend(), bend(1.0))))
    assert lines(text, 1)[-1] == "2 - - - - - - one law does as well"
    assert [line[0] for line in lines(text)[2:]] == ["1", "2"]


def test_where_two_windows_meet_is_told_with_its_error():
    meeting = xr.Dataset({"abscissa": 0.61234567, "abscissa_error": 0.0123, "ordinate": 4.5678912}, attrs=NAMES)
    text = laws_text(found(fit(), fit(low=2.0), meeting=meeting))
    assert lines(text, 1)[-1] == "0.612346 +- 1.2e-02 4.56789"
    assert [line[0] for line in lines(text)[2:]] == ["1", "2"]


def test_a_page_tells_one_law_in_a_row():
    (row,) = law_rows(found())
    assert row == ("period", "mu 1 to 1.235e+04", "-0.33333333", "-0.35 to -0.31", "4.6e-05")


def test_a_page_tells_which_side_of_the_bend_a_law_holds_on():
    low, high = law_rows(found(bend=bend()))
    assert low == ("period", "mu << 0.765", "-1", "-1.1 to -0.9", "9.9e-02")
    assert high == ("period", "mu >> 0.765", "-0.333333", "-0.34 to -0.33", "9.9e-02")


def test_a_line_without_a_value_of_its_own_is_numbered():
    rows = law_rows(found(xr.concat([fit(), fit()], "cell")))
    assert [row[0] for row in rows] == ["period (cell = 0)", "period (cell = 1)"]


def test_the_table_has_a_row_for_each_line_and_law(tmp_path):
    fits = along(["=x", "y"], fit(), fit())
    meeting = xr.Dataset({"abscissa": 0.5}, attrs=NAMES)
    write_laws(found(fits, bend=bend(), meeting=meeting), tmp_path / "laws.csv")
    head, *rows = (tmp_path / "laws.csv").read_text().splitlines()
    assert head.startswith("y,x,law,a,low,high,exponent,")
    assert [row.split(",")[:5] for row in rows[:2]] == [["period", "mu", "one", a, "1.0"] for a in ("'=x", "y")]
    assert [row.split(",")[2] for row in rows] == ["one", "one", "low", "high", "meeting"]
    exponent = head.split(",").index("exponent")
    assert [row.split(",")[exponent] for row in rows[2:4]] == ["-1.00000049", "-0.3333333"]
    assert rows[-1].split(",")[head.split(",").index("abscissa")] == "0.5"


def line_of(values, x=None, status=None):
    mu = np.geomspace(1.0, 100.0, len(values)) if x is None else x
    dataset = xr.Dataset({"period": ("mu", np.asarray(values))}, {"mu": mu})
    if status is not None:
        flags = {"flag_values": np.array([0, 1, 64], np.int8), "flag_meanings": "OK INACCURATE BAD_INPUT"}
        dataset["status"] = ("mu", np.asarray(status, np.int8), flags)
    return dataset


def test_a_second_law_needs_eight_points_and_no_straight_line():
    def bent(n):
        x = np.geomspace(1e-4, 1e4, n)
        return line_of(x**-1 + x**-0.25, x)

    assert laws(bent(8), "period", "mu").bend is not None
    assert laws(bent(7), "period", "mu").bend is None
    x = np.geomspace(1, 100, 21)
    assert laws(line_of(x**-0.5, x), "period", "mu").bend is None


@pytest.mark.parametrize(
    ("value", "found"), [("1.00001", True), ("0.999991", True), ("1.0000101", False), ("0.999989", False)]
)
def test_a_number_is_found_to_its_sixth_digit(value, found):
    dataset = line_of([5.0, 6.0, 7.0], np.array([1.0, 2.0, 4.0]))
    if found:
        assert pick(dataset, [f"mu={value}"]).period.item() == 5.0
    else:
        with pytest.raises(SweepError, match=f"--at mu={value}: mu has no such value; nearest is 1 or 2"):
            pick(dataset, [f"mu={value}"])


def test_a_value_that_is_no_number_is_picked_too():
    assert pick(line_of([5.0, 6.0], np.array([1.0, np.nan])), ["mu=nan"]).period.item() == 6.0


def test_each_choice_narrows_what_the_one_before_left():
    dataset = xr.Dataset({"y": (("a", "b"), np.arange(6.0).reshape(2, 3))}, {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]})
    assert pick(dataset, ["a=2", "b=3"]).y.item() == 5.0
    assert pick(dataset, []) is dataset


# laws compared

CHANCES = {0.5: "0.5", 0.0123: "0.012", 1e-4: "0.0001", 9e-5: "< 1e-4", 0.0: "< 1e-4", np.nan: "-"}


def compared(**columns):
    laws = {
        "worse": [0.0, 10.0, 10.5], "bic": [-52.0, -40.0, -12.0], "numbers": [3, 5, 2],
        "residual": [1e-3, 2e-3, 0.5], "runs": [0.5, 0.5, 0.5], "exponents": ["-1", "-1, -0.33", "-0.6"],
    }  # fmt: skip
    columns = {name: ("law", column) for name, column in (laws | columns).items()}
    names = {"y": "period", "x": "mu", "chosen": "one", "verdict": "one law by 10"}
    return xr.Dataset(columns | {"y": ("point", np.ones(7))}, {"law": ["one", "two", "bend"]}, names)


def rows_of(found):
    """Words of each law's line, its name first."""
    lines = [line.split() for line in comparison_text(found).splitlines()]
    return {words[0]: words[1:] for words in lines if words and words[0] in ("one", "two", "bend")}


@pytest.mark.parametrize("chance", CHANCES)
def test_a_chance_is_a_number_down_to_one_in_ten_thousand(chance):
    found = " ".join(rows_of(compared(runs=[chance, 0.5, 0.5]))["one"])
    assert found == f"0 0 3 1.0e-03 {CHANCES[chance]} -1"


def test_a_law_is_ruled_out_above_ten_and_bic_counts_from_the_best():
    found = rows_of(compared())
    assert found["two"] == ["10", "12", "5", "2.0e-03", "0.5", "-1,", "-0.33"]
    assert found["bend"] == ["10.5", "40", "2", "5.0e-01", "0.5", "ruled", "out"]


def test_the_table_has_a_row_for_each_law_and_marks_the_chosen(tmp_path):
    found = compared(exponents=["-1", "-1, -0.33", "=x"])
    write_comparison(found, tmp_path / "laws.csv")
    assert (tmp_path / "laws.csv").read_text().splitlines() == [
        "y,x,law,chosen,worse,bic,numbers,residual,runs,exponents",
        "period,mu,one,1,0.0,-52.0,3,0.001,0.5,-1",
        'period,mu,two,0,10.0,-40.0,5,0.002,0.5,"\'-1, -0.33"',
        "period,mu,bend,0,10.5,-12.0,2,0.5,0.5,'=x",
    ]


def line_along(**attrs):
    x = np.geomspace(1, 1e3, 13)
    columns = {"y": (("a", "b", "x"), np.ones((2, 1, 1)) / x)}
    return xr.Dataset(columns, {"a": [1.0, 2.0], "b": [3.0], "x": x}, attrs)


def test_laws_of_one_line_are_compared_in_one_window():
    one = line_along().isel(a=0)
    assert comparison(one, "y", "x").sizes["point"] == 13
    assert comparison(one, "y", "x", [(1, 100)]).sizes["point"] == 9
    with pytest.raises(SweepError, match="--window: with --compare expected one, found 2"):
        comparison(one, "y", "x", [(1, 10), (10, 100)])


@pytest.mark.parametrize(
    ("attrs", "how"), [({}, "choose with --at a=value"), ({"lines": "take another"}, "take another")]
)
def test_more_lines_than_one_are_refused_with_what_to_do(attrs, how):
    with pytest.raises(SweepError, match=f"^--compare: y also runs along a; {how}$"):
        comparison(line_along(**attrs), "y", "x")


# results


@pytest.fixture
def product():
    """31 heights by 4 speeds, of which two are refused."""
    axes = {"height": {"spacing": "log", "start": 1, "stop": 1000, "num": 31}, "v0": [0.0, 1.0, -1.0, np.nan]}
    return sweep.run(build(axes=axes, outputs=["fall_time", "impact_speed"]), progress=False)


@pytest.fixture
def zipped():
    """Six cells: two speeds at three heights."""
    axes = {"height": [1.0, 1.0, 2.0, 2.0, 4.0, 4.0], "v0": [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]}
    return sweep.run(build(axes=axes, design="zip"), progress=False)


@pytest.mark.parametrize("at_once", [1, 4, 12, 1 << 22])
def test_a_status_is_told_with_the_part_of_each_axis_where_it_occurs(product, monkeypatch, at_once):
    monkeypatch.setattr(report, "CELLS_AT_ONCE", at_once)
    product.status[20:23, 1] = int(Status.NOT_CONVERGED)
    heights = product.height.values
    text = " ".join(result_text("x.h5", product).split())
    assert " 3 NOT_CONVERGED " in text
    assert f"height {heights[20]:.6g} to {heights[22]:.6g}, v0 1; e.g. height=100.0 v0=1.0" in text


def test_a_status_in_a_zip_is_told_by_the_values_of_its_cells(zipped):
    zipped.status[2:5] = int(Status.NOT_CONVERGED)
    text = " ".join(result_text("x.h5", zipped).split())
    assert "height 2 to 4, v0 0 to 1; e.g. height=2.0 v0=0.0" in text


def test_the_share_that_is_done_is_told_and_never_rounded_up(product):
    product.status[:, 3] = int(Status.PENDING)
    assert "x.h5: unfinished: 93 of 124 cells (75 %)" in result_text("x.h5", product)
    product.status[:] = 0
    product.status[0, 0] = int(Status.PENDING)
    assert "123 of 124 cells (99.1 %)" in result_text("x.h5", product)


def test_a_result_without_trouble_is_summed_up_in_one_line(zipped):
    assert (
        summary_text(zipped)
        == "6 cells: 6 ok, 0 remarked, 0 refused, 0 unsolved, 0 FAILED, 0 pending; solved by rough 3, exact 3"
    )


def test_an_axis_of_words_is_told_by_its_words():
    dataset = sweep.run(build(axes={"height": [1.0, 2.0], "method": ["exact", "auto"]}), progress=False)
    assert "method  " in (text := result_text("x.h5", dataset))
    assert "exact, auto" in text


# picking


def test_a_value_picked_from_a_product_takes_its_dimension_away(product):
    part = pick(product, ["v0=1"])
    assert part.fall_time.dims == ("height",)
    assert float(part.v0) == 1.0


def test_a_value_picked_from_a_zip_keeps_all_its_cells(zipped):
    part = pick(zipped, ["v0=1"])
    assert part.height.values.tolist() == [1.0, 2.0, 4.0]
    assert (part.v0 == 1).all()


def test_a_value_as_it_was_printed_is_found_and_the_nearest_of_several_taken():
    values = [0.333330, 1 / 3, 0.333336]
    dataset = sweep.run(build(axes={"height": values}), progress=False)
    assert float(pick(dataset, ["height=0.333333"]).height) == 1 / 3


def test_reductions_and_cells_that_failed_are_shown(tmp_path):
    keys = {"axes": {"height": [1.0, 2.0], "v0": [0.0, 1.0, -1.0]}, "summary": {"over": ["v0"]}}
    keys["summary"]["outputs"] = {"fall_time": ["min", "mean"]}
    words = result_text("x.h5", sweep.run(build(**keys), progress=False)).split()
    assert {"reduced", "fall_time_min", "fall_time_mean", "BAD_INPUT"} <= set(words)
    axes = {"height": [1.0, 11.0, *np.arange(20.0, 50.0)]}
    (tmp_path / "x.h5.log").write_text("2026-01-01 00:00:00  cell 1 FAILED (height=11): eleven\n")
    with sweep.run(build(kernel="bad:RAISING", axes=axes), tmp_path / "x.h5", progress=False) as found:
        text = result_text(tmp_path / "x.h5", found)
    assert text.split("FAILED, and why\n")[1].split()[:3] == ["cell", "1", "height=11.0"]
    assert "eleven" in text


# logs


def logged(k, text=None):
    return f"2026-01-01 00:00:{k:02}  {text or f'line {k}'}\n"


@pytest.fixture
def log(tmp_path):
    return tmp_path / "x.h5.log"


def told(log, *later):
    """What is told, where each pause adds the next of `later` to the log; and the pauses."""
    pauses, waiting = [], list(later)

    def sleep(seconds):
        pauses.append(seconds)
        if waiting:
            log.write_text(log.read_text() + waiting.pop(0))

    return list(follow(log.with_suffix(""), sleep)), pauses


def test_the_last_ten_lines_are_told_and_an_ended_run_is_not_waited_for(log):
    log.write_text("".join(logged(k) for k in range(12)) + logged(12, "ended with 3 cells"))
    said, pauses = told(log)
    assert said == [logged(k).strip() for k in range(3, 12)] + [logged(12, "ended with 3 cells").strip()]
    assert pauses == []


def test_each_new_line_is_told_once(log):
    log.write_text(logged(0))
    said, pauses = told(log, logged(1), "", logged(2) + logged(3), logged(4, "ended with 1 cells"))
    assert said == [*(logged(k).strip() for k in range(4)), logged(4, "ended with 1 cells").strip()]
    assert pauses == [LOOK_SECONDS] * 4


def test_all_new_lines_are_told_however_many(log):
    log.write_text(logged(0))
    said, _ = told(log, "".join(logged(k) for k in range(1, 30)), logged(30, "ended with 1 cells"))
    assert len(said) == 31


def test_a_log_that_is_silent_for_ten_minutes_is_given_up(log):
    log.write_text(logged(0))
    pauses = []
    with pytest.raises(SweepError, match=r"x\.h5\.log: nothing new for 600 s; its run was killed"):
        list(follow(log.with_suffix(""), pauses.append))
    assert sum(pauses) == SILENT_SECONDS == 600


def test_a_line_begins_the_wait_anew(log):
    """Even one of the last half second."""
    log.write_text(logged(0))
    said, pauses = told(log, *[""] * 1199, logged(1), *[""] * 1199, logged(2, "ended with 1 cells"))
    assert (len(said), len(pauses)) == (3, 2400)


def test_without_a_log_there_is_nothing_to_follow(log):
    with pytest.raises(SweepError, match="there is no log to follow"):
        list(follow(log.with_suffix("")))


def test_reasons_are_those_of_cells_that_failed(log):
    assert reasons(log.with_suffix("")) == {}
    texts = ["cell 3 FAILED (mu=1): no root: twice", "cell x FAILED (mu=1): no", "cell 7 solved", "cell 12 FAILED ("]
    log.write_text("".join(logged(k, text) for k, text in enumerate(texts)))
    assert reasons(log.with_suffix("")) == {3: "no root: twice", 12: ""}
