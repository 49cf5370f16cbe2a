"""What is printed of results and laws: tables, where a status occurs, what is picked."""

import csv

import numpy as np
import pytest
import xarray as xr
from toy_studies import build

import sweep
from kernels.interface import Status
from sweep.errors import SweepError
from sweep.show.laws import comparison, comparison_text, laws, laws_text, pick, write_laws
from sweep.show.text import result_text

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
    assert "residual" in laws_text(found, complete=True)


def test_a_line_that_cannot_be_fitted_has_the_reason_in_the_table():
    text = laws_text(laws(lines_of(BENT, np.nan * X, -BENT, a=[1.0, 2.0, 3.0]), "y", "x"), complete=True)
    assert "too few points" in " ".join(text.split())
    assert "not positive" in " ".join(text.split())
    assert "nan" not in text


def test_laws_of_one_line_are_compared_in_one_window():
    found = comparison(lines_of(BENT).isel(a=0), "y", "x")
    ruled_out = {str(law) for law in found.law.values[found.worse.values > 10]}
    text = comparison_text(found)
    told = {law for law in ruled_out if any(law in line and "ruled out" in line for line in text.splitlines())}
    assert told == ruled_out != set()
    assert comparison(lines_of(BENT).isel(a=0), "y", "x", [(1, 100)]).sizes["point"] == 9
    many = lines_of(BENT, BENT)
    with pytest.raises(SweepError, match="--window"):
        comparison(many.isel(a=0), "y", "x", [(1, 10), (10, 100)])
    with pytest.raises(SweepError, match="--at a="):
        comparison(many, "y", "x")


# picking


@pytest.mark.parametrize("value", ["1.00001", "0.999991", "1.0000101", "0.999989", "nan"])
def test_a_number_is_found_to_its_sixth_digit(value):
    dataset = xr.Dataset({"y": ("a", [5.0, 6.0, 7.0])}, {"a": [1.0, 2.0, np.nan]})
    if value in ("1.0000101", "0.999989"):
        with pytest.raises(SweepError, match="1 or 2"):
            pick(dataset, [f"a={value}"])
    else:
        assert pick(dataset, [f"a={value}"]).y.item() == (7.0 if value == "nan" else 5.0)


@pytest.mark.parametrize("value", ["2 rad", "114.591559 degree", "  0.3183099 turn "])
def test_a_number_may_have_a_unit(value):
    angle = xr.DataArray([1.0, 2.0], dims="angle", attrs={"units": "rad"})
    dataset = xr.Dataset({"y": ("angle", [5.0, 6.0])}, {"angle": angle})
    assert pick(dataset, [f"angle={value}"]).y.item() == 6.0
    with pytest.raises(SweepError, match='"kg" is a mass'):
        pick(dataset, ["angle=2 kg"])


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
    assert "height 100 to 158.489, v0 1; e.g. height=100 v0=1" in text


@pytest.mark.parametrize("heights", [[2.0], [2.0, 2.0 + 1e-9]])
def test_an_output_of_one_value_is_told_as_one_number(heights):
    text = result_text("x.h5", sweep.run(build(axes={"height": heights}), progress=False))
    assert "  0.63866  " in text.partition("outputs")[2]
    assert "0.63866 to" not in text


def test_a_fixed_word_is_told_as_the_word(tmp_path):
    """By `sweep show` and `sweep cell`, in conditions and in tables; for other programs its number has a meaning."""
    fixed = {"J": [1.0, 2.0], "k": 3.0, "n_keep": 1, "reduction": "rivin"}
    found = sweep.run(kernel="drivetrain", outputs=["n_kept"], axes={"f_max": [1.0]}, fixed=fixed)
    assert "reduction [1] rivin" in " ".join(result_text("x.h5", found).split())
    assert "reduction = rivin" in str(found.sweep.cell(f_max=1.0))
    assert sweep.where(found, "reduction == 'rivin'").sizes["cell"] == 1
    lines = sweep.export(found, tmp_path / "x.csv").read_text().splitlines()
    row, *_ = csv.DictReader(line for line in lines if not line.startswith("#"))
    assert row["reduction"] == "rivin"
    numbers, words = found.reduction.attrs["flag_values"], found.reduction.attrs["flag_meanings"].split()
    assert words[list(numbers).index(found.reduction.item())] == "rivin"


def test_a_summary_that_is_complete_holds_nothing_that_is_pending():
    """Where no cell has a value, there is no cell at the extreme, and so no status."""
    summary = {"over": ["height"], "outputs": {"fall_time": ["argmin"]}}
    found = sweep.run(build(axes={"v0": [0.0, 1.0], "height": [-1.0, -2.0]}, summary=summary), progress=False)
    assert "fall_time_argmin_status none" in " ".join(result_text("x.h5", found).split())
    assert "PENDING" not in result_text("x.h5", found)
