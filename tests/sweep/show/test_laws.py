"""The tables of `sweep fit`, digit by digit, of laws that are made by hand."""

import numpy as np
import pytest
import xarray as xr

from sweep.show import laws as module
from sweep.show.laws import Laws, law_rows, laws, laws_text, pick, write_laws
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


def test_what_the_columns_mean_and_the_remark_follow():
    text = " ".join(laws_text(found(remark="Of 3 cells: 1 FAILED (left out).")).split())
    assert "2.71828 Of 3 cells: 1 FAILED (left out). The interval is of 90 % confidence where" in text


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (-0.35, -0.31, "-0.35 to -0.31"),
        (0.99999, 1.00001, "0.99999 to 1.00001"),
        (1.23456, 2.34567, "1.23 to 2.35"),
        (-0.123456789, 100.0, "-0.123 to 100"),
        (-0.123456789, -0.1234, "-0.123457 to -0.1234"),
        (1.23456789012, 1.23456789012, "1.2345679 to 1.2345679"),
        (1.0, 1.0 + 2**-52, "1 to 1"),
        (0.5, np.inf, "0.5 to inf"),
        (np.nan, np.nan, "nan to nan"),
        (-1e-3, 1e-3, "-0.001 to 0.001"),
        (1.23456, 1.345678, "1.235 to 1.346"),
        (1.0, 1.1, "1 to 1.1"),
    ],
)
def test_an_interval_has_two_digits_more_than_tell_its_ends_apart(low, high, text):
    assert module._interval(low, high) == text


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


def test_at_most_forty_lines_are_told():
    text = laws_text(found(along(np.arange(40.0), *[fit()] * 40)))
    assert (len(lines(text)), "more;" in text) == (42, False)
    text = laws_text(found(along(np.arange(41.0), *[fit()] * 41)))
    assert (len(lines(text)), lines(text)[-1]) == (43, "and 1 more; choose with --at axis=value")


def test_a_page_tells_one_law_in_a_row():
    (row,) = law_rows(found())
    assert row == ("period", "mu 1 to 1.235e+04", "-0.33333333", "-0.35 to -0.31", "4.6e-05")


@pytest.mark.parametrize(("residual", "rows"), [(0.1, 2), (0.1001, 1)])
def test_a_page_tells_two_laws_where_no_point_is_off_by_more_than_a_tenth(residual, rows):
    assert len(list(law_rows(found(bend=bend(residual=residual))))) == rows
    assert len(list(law_rows(found(bend=bend(1.0, residual=residual))))) == 1


def test_a_page_tells_which_side_of_the_bend_a_law_holds_on():
    low, high = law_rows(found(bend=bend()))
    assert low == ("period", "mu << 0.765", "-1", "-1.1 to -0.9", "9.9e-02")
    assert high == ("period", "mu >> 0.765", "-0.333333", "-0.34 to -0.33", "9.9e-02")


def test_a_page_tells_of_each_line_what_holds_there():
    both = along([0.5, 2.0], bend(), bend(1.0))
    rows = list(law_rows(found(along([0.5, 2.0], fit(), fit()), bend=both)))
    assert [row[:2] for row in rows] == [
        ("period (a = 0.5)", "mu << 0.765"),
        ("period (a = 0.5)", "mu >> 0.765"),
        ("period (a = 2)", "mu 1 to 1.235e+04"),
    ]


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


def test_a_fit_tells_which_cells_have_no_part_in_it():
    dataset = line_of([1.0, 2.0, np.nan, 4.0, np.nan, np.nan, 7.0], status=[0, 1, 1, 64, 64, 64, 3])
    bad = "1 3 (in the fit), 1 BAD_INPUT (in the fit), 2 BAD_INPUT (left out)"
    assert (
        module._remark(dataset, "period") == f"Of 7 cells: 1 INACCURATE (in the fit), 1 INACCURATE (left out), {bad}."
    )
    assert module._remark(line_of([1.0, 2.0], status=[0, 0]), "period") == ""
    assert module._remark(line_of([1.0, 2.0]), "period") == ""


def test_a_second_law_needs_eight_points_and_no_straight_line():
    def bent(n):
        x = np.geomspace(1e-4, 1e4, n)
        return line_of(x**-1 + x**-0.25, x)

    assert laws(bent(8), "period", "mu").bend is not None
    assert laws(bent(7), "period", "mu").bend is None
    x = np.geomspace(1, 100, 21)
    assert laws(line_of(x**-0.5, x), "period", "mu").bend is None


def test_two_windows_have_a_meeting_and_no_bend():
    x = np.geomspace(1e-4, 1e4, 41)
    both = laws(line_of(x**-1 + x**-0.25, x), "period", "mu", [(1e2, 1e4), (1e-4, 1e-2)])
    assert both.bend is None
    assert both.meeting is not None
    assert [float(one.low) for one in both.fits] == pytest.approx([1e-4, 100.0])
    with pytest.raises(SweepError, match="--window: expected one or two, found 3"):
        laws(line_of(x), "period", "mu", [(1, 2)] * 3)


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


def test_a_word_is_picked_alone():
    assert pick(line_of([5.0, 6.0, 7.0], ["b", "a", "c"]), ["mu=a"]).period.item() == 6.0


def test_each_choice_narrows_what_the_one_before_left():
    dataset = xr.Dataset({"y": (("a", "b"), np.arange(6.0).reshape(2, 3))}, {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]})
    assert pick(dataset, ["a=2", "b=3"]).y.item() == 5.0
    assert pick(dataset, []) is dataset
