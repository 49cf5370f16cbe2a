"""What a study knows of its own shape: dimensions, rows of cells, lengths; and short texts of values."""

import numpy as np
import pytest
from toy_studies import build

from kernels.interface import Field
from sweep.study.model import differs, short

AXES = {"height": [1.0, 2.0, 3.0], "v0": [0.0, 1.0], "g": [1.0, 2.0, 3.0, 4.0]}


def test_a_product_has_a_dimension_for_each_axis_and_rows_of_those_behind():
    study = build(axes=AXES)
    assert study.grid_shape == {"height": 3, "v0": 2, "g": 4}
    assert [study.run(name) for name in AXES] == [8, 4, 1]


def test_blocks_that_run_together_are_points_counted_from_the_second_on():
    zips = [{"design": "zip", "axes": {name: values}} for name, values in AXES.items()]
    study = build(blocks=zips)
    assert study.dims == {"point": ("height",), "point_2": ("v0",), "point_3": ("g",)}
    assert [study.run(name) for name in AXES] == [8, 4, 1]
    assert build(axes={n: [1.0, 2.0] for n in AXES}, design="zip").dims == {"cell": tuple(AXES)}


def test_what_a_summary_reduces_comes_last():
    study = build(axes=AXES, summary={"over": ["height"], "outputs": {"fall_time": ["min"]}})
    assert list(study.dims) == ["v0", "g", "height"]
    assert [study.run(name) for name in AXES] == [1, 12, 3]


def test_shapes_are_those_of_one_cell():
    study = build(axes=AXES, outputs=["fall_time", "drop"], along={"phase": {"num": 7}})
    assert study.shapes == {"fall_time": (), "drop": (7,)}
    assert study.lengths == {"phase": 7}
    assert [field.name for field in study.asked] == ["fall_time", "drop"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1 / 3, "0.333333"),
        (1234567.0, "1.23457e+06"),
        ([1.0, 2.0, 3.0], "(1, 2, 3)"),
        ([1.0, 2.0, 3.0, 4.0], "(1, 2, 3, ...)"),
        ([1 / 3], "(0.333333)"),
    ],
)
def test_a_value_in_short_has_six_digits_and_three_numbers(value, text):
    assert short(np.array(value)) == text


def test_a_parameter_differs_where_it_is_not_its_default():
    one, other = Field("c", "1", "", default=0.5), Field("d", "1", "", default="c")
    assert not differs(one, {"c": 0.5})
    assert differs(one, {"c": 0.25})
    assert not differs(one, {})
    assert not differs(Field("e", "1", ""), {"e": 1.0})
    assert not differs(other, {"c": 2.0, "d": 2.0})
    assert differs(other, {"c": 2.0, "d": 0.5})
    assert not differs(one, {"c": np.array([0.5, 0.5])})
    assert differs(one, {"c": np.array([0.5, 0.75])})
