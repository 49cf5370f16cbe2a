"""Steps by which scalings are found: slopes of a law known on paper, echelon forms, fractions, and what they cost."""

from fractions import Fraction as F
from types import SimpleNamespace

import numpy as np
import pytest
from toy_studies import build

from kernels.interface import FIRST_REFUSAL, Status
from sweep.cells.grid import Cells
from sweep.explore import symmetries
from sweep.explore.symmetries import Scalings


def test_the_rank_is_what_scalings_do_to_some_fields():
    rows = ({"a": F(1), "c": F(2), "d": F(1)}, {"b": F(1), "c": F(-1)})
    found = Scalings(rows, ("a", "b"), 0, 5)
    assert found.weights("c") == (2, -1)
    assert found.weights("nowhere") == (0, 0)
    assert [found.rank(names) for names in ([], ["a"], ["a", "d"], ["a", "b", "c"], ["nowhere"])] == [0, 1, 1, 2, 0]


def test_the_echelon_form_by_hand():
    found, leading = symmetries._reduced(
        np.array([[0.0, 2.0, 4.0, 2.0], [1.0, 1.0, 0.0, 3.0], [2.0, 2.0, 0.0, 6.0]]), 4
    )
    assert leading == [0, 1]
    np.testing.assert_allclose(found, [[1, 0, -2, 2], [0, 1, 2, 1]], atol=1e-15)
    tiny, leading = symmetries._reduced(np.array([[0.9e-4, 1.0], [0.0, 1.0]]), 2)
    assert leading == [1]
    assert tiny.tolist() == [[0.0, 1.0]]
    assert symmetries._reduced(np.array([[1.1e-4, 1.0]]), 2)[1] == [0]
    assert symmetries._reduced(np.empty((0, 2)), 2)[1] == []


@pytest.mark.parametrize(
    ("value", "fraction"),
    [
        (0.5, F(1, 2)),
        (-1 / 3 + 1.9e-5, F(-1, 3)),
        (1e-5, F(0)),
        (2 + 1.9e-5, F(2)),
        (1 / 199, F(1, 199)),
        (1 / 200, F(1, 200)),
        (1 / 201, None),
        (2 + 2.1e-5, None),
    ],
)
def test_the_simplest_fraction_near_a_number(value, fraction):
    assert symmetries._simplest(value) == fraction


def test_rows_are_rational_or_none_are():
    rows = np.array([[0.5, 0.0], [1.0, -2.0]])
    assert symmetries._rational(rows, ["a", "b"]) == [{"a": F(1, 2)}, {"a": F(1), "b": F(-2)}]
    assert symmetries._rational(np.array([[0.5, 0.0], [1.0, 2 + 2.1e-5]]), ["a", "b"]) == []


def test_slopes_are_those_of_the_law():
    """Impact speed (v0^2 + 2 g h)^(1/2): its logarithm has the slope g h / (v0^2 + 2 g h) in that of h."""
    study = build(axes={"height": [0.5, 1.0, 2.0, 3.0], "v0": [1.0, 2.0, 5.0]}, outputs=["impact_speed"])
    trial = symmetries._Trial(study, 6, seed=1)
    axes, g = trial._study.axes, 9.80665
    height, v0 = axes["height"].values, axes["v0"].values
    np.testing.assert_allclose(trial._slopes("height"), g * height / (v0**2 + 2 * g * height), rtol=1e-8)
    np.testing.assert_allclose(trial._slopes("v0"), v0**2 / (v0**2 + 2 * g * height), rtol=1e-7)
    assert trial.number == 6
    for name, values in (("height", [0.5, 1.0, 2.0, 3.0]), ("v0", [1.0, 2.0, 5.0])):
        off = abs(np.log(axes[name].values[:, None] / values)).min(axis=1)
        assert 0 < off.max() <= 0.5
    good = {"height": F(2), "v0": F(1), "impact_speed": F(1)}
    assert trial.holds(good)
    assert not trial.holds(good | {"impact_speed": F(1001, 1000)})
    assert not trial.holds({})


def cells_of(values, *status):
    return Cells({"x": np.array(values, float)}, np.array(status, np.int8), None)


def test_logarithms_of_what_has_a_value():
    found = symmetries._logs(cells_of([-np.e, 0.0, 1.0, 1.0, 1.0], 0, 0, FIRST_REFUSAL, Status.PENDING, 0), "x")
    np.testing.assert_array_equal(found[:, 0], [1.0, np.nan, np.nan, np.nan, 0.0])
    for elements, kept in ((16, 16), (17, 9), (32, 16), (33, 11)):
        assert symmetries._logs(cells_of(np.ones((1, elements)), 0), "x").shape == (1, kept)
    said = [Status.INACCURATE, Status.GRAZING, Status.OK]
    assert symmetries._settled(cells_of([1, 1, 1], *said)).tolist() == [0, Status.GRAZING, 0]


@pytest.mark.parametrize(
    ("cost", "fields", "found"),
    [
        (1e-6, 2, (24, True)),
        (0.0099, 1, (10, True)),
        (0.0099, 2, (8, True)),
        (0.0199, 2, (4, True)),
        (0.021, 2, (4, False)),
    ],
)
def test_as_many_cells_are_taken_as_two_seconds_allow(monkeypatch, cost, fields, found):
    now, solved = iter([1.0, 1.0 + 4 * cost]), []
    monkeypatch.setattr(symmetries, "time", SimpleNamespace(perf_counter=lambda: next(now)))
    monkeypatch.setattr(symmetries, "solved", lambda study: solved.append(len(study.axes["height"])))
    assert symmetries._affordable(build(axes={"height": [1.0, 2.0]}), fields) == found
    assert solved == [4, 4]
