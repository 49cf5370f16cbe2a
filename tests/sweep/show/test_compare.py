"""The table of `sweep fit --compare`: its numbers are those of `compare_laws`."""

import numpy as np
import pytest
import xarray as xr

from sweep.show.compare import comparison, comparison_text, write_comparison
from sweep.system.errors import SweepError

CHANCES = {0.5: "0.5", 0.0123: "0.012", 1e-4: "0.0001", 9e-5: "< 1e-4", 0.0: "< 1e-4", np.nan: "-"}


def compared(**columns):
    laws = {
        "worse": [0.0, 10.0, 10.5], "bic": [-52.0, -40.0, -12.0], "numbers": [3, 5, 2],
        "residual": [1e-3, 2e-3, 0.5], "runs": [0.5, 0.5, 0.5], "exponents": ["-1", "-1, -0.33", "-0.6"],
    }  # fmt: skip
    columns = {name: ("law", column) for name, column in (laws | columns).items()}
    names = {"y": "period", "x": "mu", "chosen": "one", "verdict": "one law by 10"}
    return xr.Dataset(columns | {"y": ("point", np.ones(7))}, {"law": ["one", "two", "bend"]}, names)


def rows(found):
    """Words of each law's line, its name first."""
    lines = [line.split() for line in comparison_text(found).splitlines()]
    return {words[0]: words[1:] for words in lines if words and words[0] in ("one", "two", "bend")}


@pytest.mark.parametrize("chance", CHANCES)
def test_a_chance_is_a_number_down_to_one_in_ten_thousand(chance):
    found = " ".join(rows(compared(runs=[chance, 0.5, 0.5]))["one"])
    assert found == f"0 0 3 1.0e-03 {CHANCES[chance]} -1"


def test_a_law_is_ruled_out_above_ten_and_bic_counts_from_the_best():
    found = rows(compared())
    assert found["two"] == ["10", "12", "5", "2.0e-03", "0.5", "-1,", "-0.33"]
    assert found["bend"] == ["10.5", "40", "2", "5.0e-01", "0.5", "ruled", "out"]


def test_the_heading_counts_points_and_the_verdict_follows():
    text = comparison_text(compared())
    assert text.startswith("period over mu, 7 points\n")
    assert "Chosen: one law by 10." in text


def test_the_table_has_a_row_for_each_law_and_marks_the_chosen(tmp_path):
    found = compared(exponents=["-1", "-1, -0.33", "=x"])
    write_comparison(found, tmp_path / "laws.csv")
    assert (tmp_path / "laws.csv").read_text().splitlines() == [
        "y,x,law,chosen,worse,bic,numbers,residual,runs,exponents",
        "period,mu,one,1,0.0,-52.0,3,0.001,0.5,-1",
        'period,mu,two,0,10.0,-40.0,5,0.002,0.5,"\'-1, -0.33"',
        "period,mu,bend,0,10.5,-12.0,2,0.5,0.5,'=x",
    ]


def lines(**attrs):
    x = np.geomspace(1, 1e3, 13)
    columns = {"y": (("a", "b", "x"), np.ones((2, 1, 1)) / x)}
    return xr.Dataset(columns, {"a": [1.0, 2.0], "b": [3.0], "x": x}, attrs)


def test_laws_of_one_line_are_compared_in_one_window():
    one = lines().isel(a=0)
    assert comparison(one, "y", "x").sizes["point"] == 13
    assert comparison(one, "y", "x", [(1, 100)]).sizes["point"] == 9
    with pytest.raises(SweepError, match="--window: with --compare expected one, found 2"):
        comparison(one, "y", "x", [(1, 10), (10, 100)])


@pytest.mark.parametrize(
    ("attrs", "how"), [({}, "choose with --at a=value"), ({"lines": "take another"}, "take another")]
)
def test_more_lines_than_one_are_refused_with_what_to_do(attrs, how):
    with pytest.raises(SweepError, match=f"^--compare: y also runs along a; {how}$"):
        comparison(lines(**attrs), "y", "x")
