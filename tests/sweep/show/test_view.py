"""What a picture shows: which cells, how many of them, and the edges around them."""

import numpy as np
import pytest
import xarray as xr

from sweep.show.view import SIDE, coordinate, edges, evened, label, setting, view


def dataset(sizes, kind=float):
    """Cell number over axes of so many values."""
    dims = tuple(sizes)
    values = np.arange(np.prod(list(sizes.values())), dtype=kind).reshape(tuple(sizes.values()))
    return xr.Dataset({"y": (dims, values)}, {n: np.arange(1.0, m + 1) for n, m in sizes.items()})


@pytest.mark.parametrize(
    ("grid", "around"),
    [
        ([1.0, 2.0, 4.0, 5.0], [0.5, 1.5, 3.0, 4.5, 5.5]),
        ([1.0, 10.0, 100.0], 10.0 ** np.array([-0.5, 0.5, 1.5, 2.5])),
        ([3.0], [2.5, 3.5]),
        ([4.0, 1.0], [5.5, 2.5, -0.5]),
    ],
)
def test_edges_are_halfway_and_as_far_outside(grid, around):
    np.testing.assert_allclose(edges(np.array(grid)), around, rtol=1e-14)


def test_eight_values_are_a_family_and_nine_a_map():
    assert not view(dataset({"mu": 12, "a": 8})).mapped
    assert view(dataset({"mu": 12, "a": 9})).mapped
    assert not view(dataset({"mu": 12})).mapped


@pytest.mark.parametrize(("cells", "drawn"), [(20_000, 20_000), (20_001, 10_001), (40_001, 13_334)])
def test_a_line_has_at_most_twenty_thousand_points(cells, drawn):
    shown = view(dataset({"mu": cells}))
    assert shown.y.size == drawn
    assert shown.y.values[1] == -(-cells // 20_000)


@pytest.mark.parametrize(("cells", "drawn"), [(2000, 2000), (2001, 1001)])
def test_a_map_has_at_most_two_thousand_cells_a_side(cells, drawn):
    assert view(dataset({"mu": cells, "a": 9})).y.shape == (9, drawn)
    assert view(dataset({"mu": cells, "a": 8})).y.shape == (8, cells)


def test_the_longest_axis_is_along_the_next_across_and_the_rest_held_in_the_middle():
    shown = view(dataset({"c": 4, "b": 5, "a": 6, "d": 3}))
    assert (shown.x, shown.along, shown.across) == ("a", "a", "b")
    assert shown.held == "$c$ = 3, $d$ = 2"
    assert shown.y.values.tolist() == [[90 * 2 + 18 * b + 3 * a + 1 for a in range(6)] for b in range(5)]
    assert (shown.status.shape, shown.status.any(), shown.meanings, shown.codes()) == ((5, 6), False, {}, [])


def test_whole_numbers_are_drawn_and_words_and_statuses_are_not():
    several = dataset({"mu": 3}, int).assign(word=("mu", ["a", "b", "c"]), one=1.0, status=("mu", [0, 1, 1]))
    assert view(several.drop_vars("y").assign(z=several.y)).y.name == "z"
    assert view(several).codes() == [1]
    assert view(several[["status"]].assign(error_bound=several.y, z=several.y)).y.name == "z"


def test_points_of_a_zip_are_not_joined_and_cells_of_a_grid_are():
    zipped = dataset({"mu": 5}).rename_dims(mu="cell").reset_index("mu")
    assert not view(zipped).joined
    assert view(dataset({"mu": 5})).joined


def test_a_dimension_without_values_is_counted_from_0():
    y = xr.DataArray(np.ones((2, 3)), dims=("a", "b"), coords={"a": [5.0, 6.0]})
    assert coordinate(y, "b").values.tolist() == [0, 1, 2]
    assert coordinate(y, "a").values.tolist() == [5.0, 6.0]


@pytest.mark.parametrize(("axes", "shape"), [(2, (SIDE, SIDE)), (3, (34, 34, 34))])
def test_cells_that_lie_anywhere_become_an_even_grid(axes, shape):
    """A plane is the same plane between its cells; of three axes and more the grid is coarser."""
    rng = np.random.default_rng(0)
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * axes)).reshape(axes, -1).T
    places = np.concatenate([corners, rng.random((20, axes))]) + 1
    names = ["a", "b", "c"][:axes]
    columns = {"y": ("cell", places @ np.arange(1.0, axes + 1)), "status": ("cell", np.zeros(len(places), np.int8))}
    scattered = xr.Dataset(columns, {name: ("cell", places[:, k]) for k, name in enumerate(names)})
    even = evened(scattered)
    assert tuple(even.sizes[name] for name in names) == shape
    np.testing.assert_allclose((even.a[0], even.a[-1]), (1.0, 2.0))
    expected = sum((k + 1) * even[name] for k, name in enumerate(names))
    np.testing.assert_allclose(even.y, expected.transpose(*even.y.dims), rtol=0.02)
    first = evened(scattered, 1)
    assert [first.sizes[name] for name in names] == [SIDE**2, *[1] * (axes - 1)]
    assert first.b.values.tolist() == pytest.approx([np.sqrt(2.0)])


def test_a_setting_has_four_digits_and_a_word_is_itself():
    assert setting(xr.DataArray(0.123456, name="drive_torque")) == "drive torque = 0.1235"
    assert setting(xr.DataArray(3, name="n", attrs={"units": "1"})) == "$n$ = 3"


def test_a_label_is_wrapped_at_the_width_asked_for():
    long = xr.DataArray(1.0, name="mu", attrs={"long_name": "drive torque per moment of inertia"})
    assert label(long, 80) == r"drive torque per moment of inertia, $\mu$"
    assert label(long, 20) == "drive torque per\nmoment of inertia," + "\n" + r"$\mu$"
