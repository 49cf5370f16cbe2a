"""What is printed of results and laws: tables, where a status occurs, what is picked, a log that is followed."""

import csv

import numpy as np
import pytest
import xarray as xr
from toy_studies import build

import sweep
from kernels.interface import Status
from sweep.show.compare import comparison, comparison_text, write_comparison
from sweep.show.follow import LOOK_SECONDS, SILENT_SECONDS, follow
from sweep.show.laws import laws, laws_text, pick, write_laws
from sweep.show.text import result_text
from sweep.system.errors import SweepError

X = np.geomspace(1e-4, 1e4, 33)
BENT = X**-1 + X**-0.25
"""Where the two laws meet, at x = 1, it is 2."""


def lines_of(*columns, a=None, x=X):
    """y over x and a, noiseless."""
    a = np.arange(1.0, len(columns) + 1) if a is None else a
    return xr.Dataset({"y": (("a", "x"), np.array(columns), {"units": "s"})}, {"a": a, "x": x})


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# laws


def test_two_laws_are_told_in_a_text_a_page_and_a_table(tmp_path):
    found = laws(lines_of(BENT, X**-0.5, a=["=x", "one"]), "y", "x")
    write_laws(found, tmp_path / "laws.csv")
    rows = rows_of(tmp_path / "laws.csv")
    assert [(row["a"], row["law"]) for row in rows if row["a"] == "'=x"] == [
        ("'=x", law) for law in ("one", "low", "high")
    ]
    low, high = (row for row in rows if row["a"] == "'=x" and row["law"] != "one")
    assert float(low["exponent"]) == pytest.approx(-1, abs=0.02)
    assert float(high["exponent"]) == pytest.approx(-0.25, abs=0.02)
    assert float(low["exponent_low"]) < float(low["exponent"]) < float(low["exponent_high"])
    assert float(low["crossover"]) == pytest.approx(1.0, rel=0.1)
    assert f"{float(low['crossover']):.6g}" in laws_text(found).split()


def test_a_second_law_needs_eight_points_and_no_straight_line():
    for points, bent in ((8, True), (7, False)):
        x = np.geomspace(1e-4, 1e4, points)
        found = laws(lines_of(x**-1 + x**-0.25, x=x).isel(a=0), "y", "x")
        assert (found.bend is not None) is bent
    assert laws(lines_of(X**-0.5).isel(a=0), "y", "x").bend is None


def test_laws_of_one_line_are_compared_in_one_window(tmp_path):
    found = comparison(lines_of(BENT).isel(a=0), "y", "x")
    write_comparison(found, tmp_path / "laws.csv")
    rows = rows_of(tmp_path / "laws.csv")
    assert sum(row["chosen"] == "1" for row in rows) == 1
    ruled_out = {row["law"] for row in rows if float(row["worse"]) > 10}
    text = comparison_text(found)
    told = {law for law in ruled_out if any(law in line and "ruled out" in line for line in text.splitlines())}
    assert told == ruled_out != set()
    assert comparison(lines_of(BENT).isel(a=0), "y", "x", [(1, 100)]).sizes["point"] == 9
    many = lines_of(BENT, BENT)
    for windows, dataset, word in (
        ([(1, 10), (10, 100)], many.isel(a=0), "--window"),
        ([], many, "--at a="),
        ([], many.assign_attrs(lines="take another"), "take another"),
    ):
        with pytest.raises(SweepError, match=word):
            comparison(dataset, "y", "x", windows)


# picking


@pytest.mark.parametrize("value", ["1.00001", "0.999991", "1.0000101", "0.999989", "nan"])
def test_a_number_is_found_to_its_sixth_digit(value):
    dataset = xr.Dataset({"y": ("a", [5.0, 6.0, 7.0])}, {"a": [1.0, 2.0, np.nan]})
    if value in ("1.0000101", "0.999989"):
        with pytest.raises(SweepError, match="nearest is 1 or 2"):
            pick(dataset, [f"a={value}"])
    else:
        assert pick(dataset, [f"a={value}"]).y.item() == (7.0 if value == "nan" else 5.0)


def test_a_value_picked_takes_its_dimension_away_and_each_choice_narrows_what_is_left():
    dataset = xr.Dataset(
        {"y": (("a", "b"), np.arange(6.0).reshape(2, 3))}, {"a": [1.0, 2.0], "b": [1 / 3, 0.33333, 3.0]}
    )
    assert pick(dataset, ["a=2", "b=3"]).y.item() == 5.0
    assert pick(dataset, ["b=0.333333"]).y.values.tolist() == [0.0, 3.0]  # the nearest of several
    zipped = sweep.run(build(axes={"height": [1.0, 1.0, 2.0], "v0": [0.0, 1.0, 1.0]}, design="zip"))
    assert pick(zipped, ["v0=1"]).height.values.tolist() == [1.0, 2.0]


# results


@pytest.mark.parametrize("design", ["product", "zip"])
def test_a_status_is_told_with_the_part_of_each_axis_where_it_occurs(design):
    axes = {"height": np.geomspace(1, 1000, 31), "v0": [0.0, 1.0, -1.0, np.nan]}
    if design == "zip":
        axes = dict(zip(axes, (m.ravel() for m in np.meshgrid(*axes.values(), indexing="ij")), strict=True))
    found = sweep.run(build(axes=axes, design=design))
    found.status.values.reshape(31, 4)[20:23, 1] = Status.NOT_CONVERGED
    text = " ".join(result_text("x.h5", found).split())
    assert " 3 NOT_CONVERGED " in text
    assert "height 100 to 158.489, v0 1; e.g. height=100.0 v0=1.0" in text


# logs


def logged(k, text=None):
    return f"2026-01-01 00:00:{k % 60:02}  {text or f'line {k}'}\n"


@pytest.fixture
def log(tmp_path):
    return tmp_path / "x.h5.log"


def followed(log, *later):
    """What is told, where each pause adds the next of `later` to the log; and the pauses."""
    pauses, waiting = [], list(later)

    def sleep(seconds):
        pauses.append(seconds)
        if waiting:
            log.write_text(log.read_text() + waiting.pop(0))

    return list(follow(log.with_suffix(""), sleep)), pauses


def test_the_last_ten_lines_are_told_then_each_new_one_once_until_the_end(log):
    end = logged(99, "ended with 3 cells")
    log.write_text("".join(map(logged, range(12))))
    said, pauses = followed(log, "", "".join(map(logged, range(12, 42))), logged(42), end)
    assert said == [*(logged(k).strip() for k in range(2, 43)), end.strip()]
    assert pauses == [LOOK_SECONDS] * 4
    assert followed(log) == (said[-10:], [])  # an ended run is not waited for


def test_a_log_that_is_silent_for_ten_minutes_is_given_up(log):
    with pytest.raises(SweepError, match="no log"):
        list(follow(log.with_suffix("")))
    log.write_text(logged(0))
    pauses = []
    with pytest.raises(SweepError, match="nothing new for 600 s"):
        list(follow(log.with_suffix(""), pauses.append))
    assert sum(pauses) == SILENT_SECONDS == 600
    said, pauses = followed(log, *[""] * 1199, logged(1), *[""] * 1199, logged(2, "ended with 1 cells"))
    assert (len(said), len(pauses)) == (3, 2400)  # a line of the last half second begins the wait anew
