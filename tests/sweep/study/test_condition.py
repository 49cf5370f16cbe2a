"""Conditions of a study: which cells they leave, in what units, and what is refused."""

import numpy as np
import pytest
from toy_studies import build, message_of

import sweep
from kernels.interface import Status

H, V = np.meshgrid([0.15, 0.16, 0.3, 1.0, 2.0, 3.0], [0.0, 1.0, 3.0], indexing="ij")
G = 9.80665


@pytest.mark.parametrize(
    ("text", "mask"),
    [
        ("height < 1", H < 1), ("height <= 1", H <= 1), ("height > 1", H > 1), ("height >= 1", H >= 1),
        ("v0 == 1", V == 1), ("v0 != 1", V != 1), ("-height > -1", H < 1), ("not v0 == 1", V != 1),
        ("v0**2 < g*height", V**2 < G * H), ("2*height > height + 1", H > 1), ("height - 1 > 1", H > 2),
        ("height*g > v0*v0", H * G > V * V), ("height/v0 < v0/g", (V > 0) & (H * G < V**2)),
        ("0.15 < height < 2", (H > 0.15) & (H < 2)), ("height > 1 or v0 > 2", (H > 1) | (V > 2)),
        ("height > 1 and v0 > 2", (H > 1) & (V > 2)), ("-height < 0 and v0 > 0", V > 0),
        ("height > 2 or v0 > 2 and height < 1", (H > 2) | (V > 2) & (H < 1)),
        ("'1.5e1 cm' < height <= '.3 m'", (H > 0.15) & (H <= 0.3)), ("'300 mm' >= height", H <= 0.3),
        ("method == 'exact'", H > 0), ("method != 'exact' or v0 > 2", V > 2),
        ("(" * 8 + "9" + "**9)" * 8 + " > height", H > 0),
    ],
)  # fmt: skip
def test_cells_are_those_that_plain_numpy_chooses(text, mask):
    axes = {"height": H[:, 0], "v0": V[0], "method": ["exact"]}
    ds = sweep.run(build(axes=axes, where=text), progress=False).isel(method=0)
    np.testing.assert_array_equal(ds.status != Status.NOT_ASKED, mask)
    np.testing.assert_array_equal(ds.fall_time.notnull(), mask)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("height", "not a condition"), ("height < True", "not allowed"), ("height and v0 < 1", "not a condition"),
        ("not height", "not a condition"), ("method + 1 < 2", "not a number"), ("height + 'a' < 2", ""),
        ("method < 1", "words with numbers"), ("'a' == 'b'", ""), ("height > 1 < 2", "two constants"),
        ("1 < 2 > height", "two constants"), ("method == 'exakt'", "exact"), ("height < [1]", "not allowed"),
        ("height // 2 < 1", "not allowed"), ("height in v0", "not allowed"), ("+height < 1", "not allowed"),
        ("height <", "cannot be read"), ("heigth < 1", "did you mean height?"),
        *((f"v0**{power} > 1", "power") for power in ("0", "10", "2.0", "v0", "-1")),
        ("v0**2 < height", "m"), ("height - v0 > 1", "meter"), ("height*g < v0", "meter"), ("v0/v0 < height", "meter"),
        ("v0 > 1 or height > v0", "meter"),
        ("height + height < v0", "meter"), ("height < '3 kg'", '"kg" is a mass; height is a length'),
        ("2*height < '3 m'", "a name alone"), ("fall_time > 1", "fall_time"), ("shape == 1", "shape"),
        ("__import__('os').system('true') == 0", "not allowed"), ("height > 'tall'", "words with numbers"),
        ("g > " + "1 + " * 300 + "1", "longer"),
    ],
)  # fmt: skip
def test_what_is_no_condition_and_unlike_quantities_are_refused(text, what):
    axes = {"height": [1.0], "v0": [1.0], "method": ["exact", "auto"]}
    assert what in message_of(lambda: build(axes=axes, where=text), "where")


def test_an_angle_is_a_number_to_a_condition():
    study = sweep.study(kernel="foliot", axes={"mu": [1.0, 9.0]}, fixed={"phi0": 1.0, "a": 1.0}, where="mu < 2*a*a + 1")
    assert study.where == "mu < 2*a*a + 1"
