"""Rounds of cuts, one step at a time: which edges, at which values, and what is told of it in the end."""

import math

import numpy as np
import pytest
import xarray as xr

import sweep
from kernels.interface import FIRST_REFUSAL, Status
from sweep.analysis.scattered import Box
from sweep.explore.judge import Judged
from sweep.explore.refiner import Refinement, Refiner, _keys


class Noted:
    """Solves cells of a toy, and notes at which values."""

    def __init__(self, **axes):
        self.study = sweep.study(
            kernel="toy:KERNEL", allow_import=True, axes=axes, outputs=["fall_time"], fixed={"g": 10.0}
        )
        self.asked = []

    def solved(self, axes):
        values = {name: axis.values for name, axis in axes.items()}
        self.asked.append({name: column.tolist() for name, column in values.items()})
        return dataset(values)

    def written(self, axes, arrays, attributes):
        return xr.Dataset(
            {name: ("cell", v) for name, v in arrays.items()} | {n: ("cell", a.values) for n, a in axes.items()}
        )


def dataset(values, status=0):
    size = len(next(iter(values.values())))
    columns = {
        "fall_time": 1 + np.sqrt(values["height"] / 5),
        "status": np.full(size, status),
        "method_used": np.ones(size),
    }
    columns["error_bound"] = np.full(size, np.nan)
    return xr.Dataset({k: ("cell", v) for k, v in columns.items()} | {k: ("cell", v) for k, v in values.items()})


def refiner(most=1000, tolerance=0.1, **axes):
    output = Noted(**axes)
    mesh = np.meshgrid(*axes.values(), indexing="ij")
    cells = dataset({name: np.ravel(column) for name, column in zip(axes, mesh, strict=True)})
    return Refiner(cells, output, ["fall_time"], tolerance, most), output


def found(size, ends, finest=None, valued=None, beside=None):
    number = len(size)
    no, yes = np.zeros(number, bool), np.ones(number, bool)
    ends = np.array(ends)
    return Judged(
        ends,
        np.array(size, float),
        ends,
        no if finest is None else np.array(finest),
        yes if valued is None else np.array(valued),
        no if beside is None else np.array(beside),
    )


def test_the_worst_edge_is_cut_first_and_none_that_shares_an_end_with_it():
    one, _ = refiner(height=[1.0, 2.0, 4.0, 8.0, 16.0])
    edges = [[0, 1], [1, 2], [2, 3], [3, 4]]
    assert one._cuts(found([0.2, 0.9, 0.3, 0.4], edges)).tolist() == [[1, 2], [3, 4]]
    assert one._cuts(found([0.3, 0.2, 0.3, 0.2], edges)).tolist() == [[0, 1], [2, 3]]  # of equal ones the first
    assert one._cuts(found([0.1, 0.1001, 0.0, 0.1], edges)).tolist() == [[1, 2]]  # more than the tolerance
    assert one._cuts(found([0.9, 0.2, 0, 0], edges, finest=[True, False, False, False])).tolist() == [[1, 2]]
    assert one._cuts(found([0.0] * 4, edges)).shape == (0, 2)


def test_a_middle_of_an_axis_in_logarithms_is_the_geometric_mean_and_is_known_again():
    one, _ = refiner(height=[1.0, 4.0, 16.0], v0=[0.0, 1.0, 2.0])
    points, values = one._middles(np.array([[0, 3], [3, 6], [1, 4]]))
    np.testing.assert_allclose(values, [[2, 0], [8, 0], [2, 1]])
    np.testing.assert_allclose(points, [[0.25, 0], [0.75, 0], [0.25, 0.5]])
    assert values[0, 0] == values[2, 0]
    one.known[0][_keys(np.array([0.25]))[0]] = 2.0000001
    assert one._middles(np.array([[0, 3]]))[1][0, 0] == 2.0000001


@pytest.mark.parametrize(("off", "same"), [(0.4, True), (0.6, False)])
def test_places_are_the_same_where_rounding_alone_tells_them_apart(off, same):
    assert (_keys(np.array([0.25]))[0] == _keys(np.array([0.25 + off * 2.0**-40]))[0]) is same


def test_an_axis_of_two_values_gets_a_middle_at_each_value_of_the_others_and_others_do_not():
    one, output = refiner(height=[1.0, 4.0], v0=[0.0, 1.0, 2.0])
    one._give_every_axis_a_middle()
    assert output.asked == [{"height": pytest.approx([2.0, 2.0, 2.0]), "v0": [0.0, 1.0, 2.0]}]
    np.testing.assert_allclose(one.points[6:], [[0.5, 0], [0.5, 0.5], [0.5, 1]])
    assert one.first == 6


def test_two_axes_of_two_values_get_a_centre_too():
    one, output = refiner(height=[1.0, 4.0], v0=[0.0, 2.0])
    one._give_every_axis_a_middle()
    assert [sorted(zip(a["height"], a["v0"], strict=True)) for a in output.asked] == [
        [(pytest.approx(2.0), 0.0), (pytest.approx(2.0), 2.0)],
        [(1.0, 1.0), (pytest.approx(2.0), 1.0), (4.0, 1.0)][: len(output.asked[1]["height"])],
    ]


def test_no_more_cells_than_allowed_are_solved():
    one, output = refiner(most=7, tolerance=1e-9, height=[1.0, 2.0, 50.0, 90.0, 99.0])
    result = one.refined()
    assert sum(len(a["height"]) for a in output.asked) == 2
    assert not result.complete
    assert (result.added, result.dataset.sizes["cell"]) == (2, 7)


def test_statuses_that_say_less_right_are_the_same_kind_and_refusals_have_no_value():
    one, _ = refiner(height=[1.0, 2.0, 3.0, 4.0, 5.0])
    part = one.parts[0]
    status = [Status.OK, Status.INACCURATE, Status.GRAZING, Status.BAD_INPUT, Status.OK]
    part["status"] = ("cell", np.array(status, np.int8))
    part["fall_time"] = ("cell", np.array([1.0, 2.0, 3.0, 4.0, np.inf]))
    assert one._kinds().tolist() == [0, 0, int(Status.GRAZING), -1, -1]
    part["status"] = ("cell", np.full(5, FIRST_REFUSAL, np.int8))
    assert one._kinds().tolist() == [-1] * 5


def test_what_is_left_is_told_by_what_would_mend_it():
    one, _ = refiner(height=[1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    edges = [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]]
    size, finest = [0.05, 0.5, 0.4, 0.3, 9.0], [True, True, True, False, False]
    beside, valued = [False, False, True, False, False], [True, True, True, True, False]
    result = one._joined(found(size, edges, finest, valued, beside), complete=False)
    assert (result.jumps, result.singular, result.error) == (1, 1, 0.3)
    assert result.unseen == {"height": "a factor 2"}
    assert one._joined(found([0.1], [[0, 1]], [True]), complete=True).error == 0.1  # the tolerance is met
    assert one._joined(found([0.1], [[0, 1]], [True]), complete=True).jumps == 0


def test_cells_are_joined_in_rising_order_and_an_even_grid_has_the_finest_step():
    one, _ = refiner(height=[1.0, 16.0, 256.0], v0=[0.0, 1.0, 4.0])
    one._solve(*one._middles(np.array([[0, 3]])))
    result = one._joined(found([0.0], [[0, 3]]), complete=True)
    cells = list(zip(result.dataset.height.values.tolist(), result.dataset.v0.values.tolist(), strict=True))
    assert cells == sorted(cells)
    assert (4.0, 0.0) in [(round(h, 9), v) for h, v in cells]
    np.testing.assert_allclose(result.dataset.fall_time, 1 + np.sqrt(result.dataset.height / 5))
    assert (result.added, result.uniform) == (1, 5 * 5)  # a quarter of each axis


def test_steps_that_rounding_made_do_not_count_as_the_finest():
    one, _ = refiner(height=[1.0, 16.0, 256.0])
    points = np.array([[0.25], [0.25 + 2.0**-41]])
    one._solve(points, one.box.values(0, points[:, 0])[:, None])
    assert one._joined(found([0.0], [[0, 1]]), complete=True).uniform == 5


def test_widths_are_factors_in_logarithms_and_differences_elsewhere():
    one, _ = refiner(height=[2.0, 4.0, 32.0], v0=[-1.0, 0.0, 4.0])
    assert one.box.logarithmic.tolist() == [True, False]
    assert one._widest(np.array([[0, 1, 3], [4, 7, 5]])) == {"height": "a factor 8", "v0": "4"}
    assert one._widest(np.empty((0, 3), np.intp)) == {"height": "a factor 1", "v0": "0"}


def test_steps_are_those_of_the_first_grid():
    one, _ = refiner(height=[1.0, 2.0, 3.0, 5.0], v0=[0.0, 1.0, 2.0])
    assert one.judges[0].steps.tolist() == [3, 2]
    assert len(one.judges) == 1
    output = Noted(height=[1.0, 2.0])
    values = {"height": np.arange(1.0, 10), "v0": np.arange(9.0) ** 2 % 7}
    study = sweep.study(kernel="toy:KERNEL", allow_import=True, axes=values, outputs=["fall_time"], design="zip")
    output.study = study
    np.testing.assert_allclose(Refiner(dataset(values), output, ["fall_time"], 0.1, 99).judges[0].steps, [3, 3])


def text(**changed):
    keys = {"dataset": dataset({"height": np.ones(1234)}), "added": 1200, "uniform": 4097, "error": 0.01}
    keys |= {"tolerance": 0.01, "complete": True, "jumps": 0, "singular": 0, "unseen": {"height": "a factor 2"}}
    return str(Refinement(**keys | changed)).splitlines()


def test_a_refinement_reads_well():
    assert text() == [
        "1,234 cells, 1,200 of them added; an even grid as fine has 4,097",
        "interpolation error left: 0.01, as the cells around tell",
        "cells are up to a factor 2 in height apart; a peak narrower than that is not seen",
    ]
    assert text(unseen={"height": "3", "v0": "a factor 2"})[0] == "1,234 cells, 1,200 of them added"
    assert text(unseen={"height": "3", "v0": "4"})[2].startswith("cells are up to 3 in height, 4 in v0 apart")
    assert text(error=0.011)[1].endswith("tell; the tolerance is not met everywhere, allow more cells")
    assert text(jumps=1)[1].endswith("tell; not in 1 place where it jumps or diverges")
    assert text(jumps=1234)[1].endswith("; not in 1,234 places where it jumps or diverges")
    assert text(singular=1)[1].endswith("; not in the 1 nearest a border of statuses, where values diverge")


def test_the_box_of_the_first_cells_stays():
    one, _ = refiner(height=[1.0, 2.0, 4.0])
    assert isinstance(one.box, Box)
    assert one.refined().error <= 0.1
    assert math.isclose(one.box.high[0], 4.0)
