"""Values of axes and points of designs, against 50 digits and the generators themselves; csv files by their limits."""

from decimal import Decimal

import mpmath
import numpy as np
import pytest
from scipy.stats import qmc

from sweep.study import samples, spacing
from sweep.study.samples import unit_points
from sweep.study.spacing import linear, logarithmic, numbered_columns, read_column, scaled, spread
from sweep.study.summary import names

SHARES = [0.0, 0.125, 0.7, 1.0]


@pytest.mark.parametrize("factor", [None, Decimal("0.001")])
def test_shares_of_the_way_are_those_of_50_digits(factor):
    with mpmath.workdps(50):
        scale = mpmath.mpf(str(factor or 1))
        shares = [mpmath.mpf(share) for share in SHARES]
        even = [float((mpmath.mpf("0.3") + mpmath.mpf("1.7") * share) * scale) for share in shares]
        ratio = [float(mpmath.mpf("0.3") * (mpmath.mpf(2) / mpmath.mpf("0.3")) ** share * scale) for share in shares]
    assert spread("linear", 0.3, 2.0, np.array(SHARES), factor).tolist() == even
    assert spread("log", 0.3, 2.0, np.array(SHARES), factor).tolist() == ratio


def test_a_factor_is_applied_before_rounding():
    assert linear(0.1, 0.3, 3, Decimal("0.001")).tolist() == [0.0001, 0.0002, 0.0003]
    assert logarithmic(1.0, 100.0, 3, Decimal("0.001")).tolist() == [0.001, 0.01, 0.1]
    given = np.array([[0.1, 0.7], [3.0, 1e300]])
    assert scaled(given, Decimal("0.001")).tolist() == [[0.0001, 0.0007], [0.003, 1e297]]
    assert scaled(given, None) is given


def test_lines_of_a_csv_file_may_be_so_long_and_no_longer(tmp_path, monkeypatch):
    monkeypatch.setattr(spacing, "LONGEST_LINE", 8)
    path = tmp_path / "a.csv"
    path.write_text("a\n1234567\n")
    assert read_column(path, "a") == [(2, "1234567")]
    path.write_text("a\n12345678\n")
    with pytest.raises(ValueError, match=r"a\.csv is not a csv file: a line is longer than 8 characters"):
        read_column(path, "a")


def test_one_value_too_many_is_read_and_no_more(tmp_path, monkeypatch):
    monkeypatch.setattr(spacing, "LARGEST_AXIS", 3)
    path = tmp_path / "a.csv"
    path.write_text("a\n" + "1\n" * 9)
    assert len(read_column(path, "a")) == 4


def test_numbered_columns_are_counted_from_1_to_the_first_gap(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("J_1, J_2,J_4,k_0\n1,2,3,4\n")
    assert numbered_columns(path, "J") == 2
    with pytest.raises(ValueError, match=r"a\.csv has no columns k_1, k_2, \.\.\.; its first line is J_1,J_2,J_4,k_0"):
        numbered_columns(path, "k")


def test_a_heading_that_is_not_there_and_a_row_too_short_are_told(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# of two\na,b\n1,2\n\n3\n")
    with pytest.raises(ValueError, match=r'a\.csv has no column "c"; its first line is a,b$'):
        read_column(path, "c")
    with pytest.raises(ValueError, match=r"a\.csv, line 5: expected 2 columns, found 1"):
        read_column(path, "a")
    path.write_text("a\n")
    with pytest.raises(ValueError, match="holds no values"):
        read_column(path, "a")
    path.write_text("1\n2\n")
    assert read_column(path, "a") == [(1, "1"), (2, "2")]


# samples


def test_designs_have_the_points_that_they_say():
    for design, points in (("sobol", 8), ("latin", 8), ("random", 8), ("saltelli", 40), ("morris", 32)):
        assert samples.count(design, 3, 8) == points
        if design in ("saltelli", "morris"):
            pytest.importorskip("SALib")
        found = unit_points(design, 3, {"n": 8, "seed": 5})
        assert found.shape == (points, 3)
        assert ((found >= 0) & (found <= 1)).all()
        assert (found == unit_points(design, 3, {"n": 8, "seed": 5})).all()


def test_points_are_scrambled_unless_told_not_to():
    plain = qmc.Sobol(2, scramble=False).random(4)
    np.testing.assert_array_equal(unit_points("sobol", 2, {"n": 4, "seed": 1, "scramble": False}), plain)
    assert (unit_points("sobol", 2, {"n": 4, "seed": 1}) != plain).any()
    centres = unit_points("latin", 2, {"n": 4, "seed": 1, "scramble": False})
    assert sorted(centres[:, 0]) == [0.125, 0.375, 0.625, 0.875]


def test_morris_moves_one_axis_at_a_time_on_four_levels():
    pytest.importorskip("SALib")
    points = unit_points("morris", 3, {"n": 5, "seed": 2}).reshape(5, 4, 3)
    assert set(np.round(np.unique(points) * 3, 12)) <= {0.0, 1.0, 2.0, 3.0}
    assert ((np.diff(points, axis=1) != 0).sum(axis=2) == 1).all()


def test_saltelli_changes_one_axis_of_a_point_for_that_of_another():
    pytest.importorskip("SALib")
    first, *changed, other = unit_points("saltelli", 3, {"n": 4, "seed": 2}).reshape(4, 5, 3).transpose(1, 0, 2)
    for k, points in enumerate(changed):
        np.testing.assert_array_equal(points[:, k], other[:, k])
        np.testing.assert_array_equal(np.delete(points, k, 1), np.delete(first, k, 1))


def test_a_problem_is_of_axes_from_0_to_1():
    assert samples.problem(("a", "b")) == {"num_vars": 2, "names": ["a", "b"], "bounds": [[0.0, 1.0], [0.0, 1.0]]}


def test_what_the_reductions_of_an_output_are_called():
    assert names("y", ["min", "argmax", "histogram"], ["a", "b"]) == [
        "y_count", "y_min", "y_argmax_a", "y_argmax_b", "y_argmax_status", "y_histogram", "y_below", "y_above",
    ]  # fmt: skip
    assert names("y", ["argmin"], ["a"]) == ["y_count", "y_argmin_a", "y_argmin_status"]
