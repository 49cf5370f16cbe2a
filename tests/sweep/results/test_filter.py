"""Conditions on cells: what they choose, and that nothing else can be written in them."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sweep
from sweep.errors import SweepError

AXES = {"height": [-1.0, 1.0, 2.0, 3.0], "v0": [0.0, 1.0]}
RESULT = sweep.run(kernel="toy:KERNEL", allow_import=True, axes=AXES, along={"phase": {"num": 3}})
H, V = np.meshgrid([-1.0, 1.0, 2.0, 3.0], [0.0, 1.0], indexing="ij")
FALLS = H > 0
SPEED = np.sqrt(V**2 + 2 * 9.80665 * np.where(FALLS, H, np.nan))


@pytest.mark.parametrize(
    ("condition", "mask"),
    [
        ("status == 'OK'", FALLS),
        ("status != 'OK'", ~FALLS),
        ("impact_speed**2 - 40 > 0", SPEED**2 > 40),
        ("impact_speed / 2 > -(0 - 3)", SPEED > 6),
        ("method_used == 'rough'", FALLS & (V == 0)),
        ("g > 9", H == H),
        ("height > '150 cm' and '1 km/hour' > v0", (H > 1.5) & (V < 1 / 3.6)),
        ("2**height > 3", 2**H > 3),
        ("height > 9**9**9**9", np.inf < H),
        ("height < 1e400", np.inf > H),
    ],
)
def test_cells_are_those_that_plain_numpy_chooses(condition, mask):
    chosen = sweep.where(RESULT, condition)
    assert chosen.status.dims == chosen.height.dims == chosen.v0.dims == ("cell",)
    assert chosen.height.values.tolist() == H[mask].tolist()
    assert chosen.v0.values.tolist() == V[mask].tolist()


def test_a_chosen_cell_keeps_all_its_values():
    chosen = sweep.where(RESULT, "height == 2 and v0 == 1")
    for name in ("fall_time", "impact_speed", "drop", "status"):
        np.testing.assert_array_equal(chosen[name][0], RESULT[name].sel(height=2.0, v0=1.0))
    assert chosen.attrs == RESULT.attrs
    assert chosen.fall_time.attrs == RESULT.fall_time.attrs
    assert float(chosen.g) == float(RESULT.g)
    assert sweep.where(sweep.where(RESULT, "status == 'OK'"), "v0 > 0").sizes["cell"] == 3
    assert sweep.where(RESULT.sel(height=2.0, v0=1.0), "v0 > 0").status.dims == ("cell",)


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        ("status == 'OKAY'", 'status is never "OKAY"; did you mean OK?'),
        (3, "found an int"),
        ("status == 0", "compares words with numbers"),
        ("height > '1 kg'", "is a mass"),
        ("2*height > '1 m'", "compare it with a name alone"),
        ("drop > 0", "runs along phase"),
        ("__import__('os').system('true')", "is not allowed"),
    ],
)
def test_what_is_no_condition_is_told(condition, message):
    with pytest.raises(SweepError) as caught:
        sweep.where(RESULT, condition)
    assert message in str(caught.value)


@given(st.text("heigtv0 <>=()'andor.+-*/_[]1e9", max_size=30))
def test_any_text_is_a_condition_or_told(text):
    with contextlib.suppress(SweepError):
        assert sweep.where(RESULT, text).sizes["cell"] <= 8
