"""What is shown, drawn and saved of a result: its own numbers, and no more of them read than that takes."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

import sweep
from sweep.show.charts import COLOURS
from sweep.show.view import View
from sweep.view import region
from sweep.view.region import Choice, shown

pytestmark = pytest.mark.skipif(not find_spec("panel"), reason="the extra view is not installed")

MAP = Choice("period", "mu", "R", {"a": 2})


class Counting(BackendArray):
    """Zeros of any shape that count how many numbers are read."""

    def __init__(self, shape, dtype):
        self.shape, self.dtype, self.read = shape, np.dtype(dtype), 0

    def __getitem__(self, key):
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._zeros)

    def _zeros(self, key):
        lengths = [len(range(n)[k]) for n, k in zip(self.shape, key, strict=True) if isinstance(k, slice)]
        self.read += int(np.prod(lengths))
        return np.zeros(lengths, self.dtype)


def large():
    """1e9 cells that nobody could read, and what counts."""
    shape, dims = (4000, 2500, 100), ("u", "v", "w")
    columns = {"y": Counting(shape, np.float64), "z": Counting(shape, np.float64), "status": Counting(shape, np.int8)}
    coords = {d: np.arange(1.0, n + 1) for d, n in zip(dims, shape, strict=True)}
    lazy = {name: (dims, indexing.LazilyIndexedArray(c)) for name, c in columns.items()}
    return xr.Dataset(lazy, coords), columns


def test_of_a_billion_cells_the_slice_alone_is_read():
    dataset, columns = large()
    shown(dataset, Choice("y", "u", None, {"v": 7, "w": 3}))
    assert (columns["y"].read, columns["status"].read, columns["z"].read) == (4000, 4000, 0)


def test_of_a_long_map_as_many_cells_as_a_picture_can_show_are_read_and_in_a_region_all():
    dataset, columns = large()
    found = shown(dataset, Choice("y", "u", "v", {"w": 3}))
    assert found.y.shape == (1250, 2000)
    assert columns["y"].read == 1250 * 2000
    near = shown(dataset, Choice("y", "u", "v", {"w": 3}, False, (1000.0, 1099.0), (500.0, 519.0)))
    assert near.values("u").tolist() == list(range(997, 1102))
    assert near.values("v").tolist() == list(range(497, 522))


def test_what_is_no_axis_has_no_exponent():
    study = sweep.study(
        kernel="foliot", design="zip", axes={"mu": [1.0, 3.0, 2.0], "a": [1.0, 2.0, 3.0]}, fixed={"phi0": 1.0}
    )
    dataset = sweep.run(study, progress=False)
    assert shown(dataset, Choice("period", "mu")).y.size == 3
    with pytest.raises(sweep.SweepError, match="mu is no"):
        shown(dataset, Choice("period", "mu", exponent=True))


# what is drawn

FLAGS = {"flag_values": np.array([0, 1, 64], np.int8), "flag_meanings": "OK INACCURATE BAD_INPUT"}


def test_lines_are_drawn_with_their_statuses_at_the_foot_where_they_have_no_value():
    values, status = [[1.0, 2.0, np.nan], [4.0, -5.0, 6.0]], np.array([[0, 1, 64], [0, 0, 0]], np.int8)
    columns = {"y": (("a", "x"), values, {"units": "s"}), "status": (("a", "x"), status, FLAGS)}
    from sweep.view.picture import Picture  # every worker reads this file, and one of them needs bokeh

    found = View(xr.Dataset(columns, {"x": [1.0, 2.0, 3.0], "a": [0.5, 0.7]}), x="x")
    linear = dict.fromkeys(("x", "y", "values"), "linear")
    drawn = Picture(found, linear)
    drawn.show(found, True)
    lines = drawn.lines.data
    np.testing.assert_array_equal(lines["ys"], [[1.0, 2.0, np.nan], [4.0, -5.0, 6.0]])
    assert [xs.tolist() for xs in lines["xs"]] == [[1.0, 2.0, 3.0]] * 2
    assert (lines["colour"], lines["name"]) == (list(COLOURS[:2]), ["a = 0.5", "a = 0.7"])
    assert drawn.marks.data["x"].tolist() == [2.0, 3.0]
    assert drawn.marks.data["y"].tolist() == [2.0, -5.0]
    assert drawn.marks.data["colour"] == [found.colour(code) for code in (1, 64)]
    drawn.show(found, False)
    assert len(drawn.marks.data["x"]) == 0
    logarithmic = Picture(found, linear | {"values": "log"})
    logarithmic.show(found, True)
    np.testing.assert_array_equal(logarithmic.lines.data["ys"], [[1.0, 2.0, np.nan], [4.0, np.nan, 6.0]])
    assert logarithmic.marks.data["y"].tolist() == [2.0, 1.0]


# what is saved


def test_the_study_of_a_region_is_the_same_scene_on_a_finer_grid(dataset, tmp_path):
    path = tmp_path / "region.toml"
    path.write_text(region.study_text(dataset, replace(MAP, x_range=(0.1, 1.0), y_range=(0.5, 3.0))))
    study = sweep.study(path)
    mu, R = study.axes["mu"], study.axes["R"]
    assert (mu.spacing, mu.values[0], mu.values[-1], len(mu)) == ("log", 0.1, 1.0, 101)
    assert (R.spacing, R.values[0], R.values[-1], len(R)) == ("linear", 0.5, 2.0, 101)
    assert (study.fixed["a"], study.fixed["phi0"], study.outputs) == (2.0, 1.0, ("period", "amplitude"))
    assert sweep.run(study, progress=False).status.size == 101 * 101


def test_a_list_of_cells_and_a_result_of_no_known_study_have_no_regions(dataset):
    study = sweep.study(kernel="foliot", design="zip", axes={"mu": [1.0, 2.0], "a": [1.0, 2.0]}, fixed={"phi0": 1.0})
    bare = dataset.drop_attrs(deep=False)
    for found, choice, word in (
        (sweep.run(study), Choice("period", "mu"), "list of cells"),
        (bare, MAP, "which study"),
        (sweep.join(dataset, dataset, axis="version"), MAP, "axis version"),
    ):
        with pytest.raises(sweep.SweepError, match=word):
            region.study_text(found, choice)
