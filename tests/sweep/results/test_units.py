"""Results in other units than the kernel's."""

import numpy as np
import pytest
import xarray as xr

import sweep
from sweep.system.errors import StudyError


@pytest.fixture
def stones():
    keys = {"axes": {"height": [1.0, 2.0]}, "along": {"phase": {"num": 3}}}
    return sweep.run(sweep.study(kernel="toy:KERNEL", allow_import=True, **keys))


def test_outputs_axes_and_fixed_parameters_change_their_unit(stones):
    ds = sweep.in_units(stones, {"fall_time": "ms", "height": "mm", "g": "cm/s^2", "impact_speed": "km/hour"})
    np.testing.assert_allclose(ds.fall_time, 1000 * stones.fall_time, rtol=4e-16)
    np.testing.assert_allclose(ds.impact_speed, 3.6 * stones.impact_speed, rtol=4e-16)
    assert ds.height.values.tolist() == [1000.0, 2000.0]
    assert ds.indexes["height"].tolist() == [1000.0, 2000.0]
    assert float(ds.g) == pytest.approx(980.665, rel=4e-16)
    assert [ds[name].attrs["units"] for name in ("fall_time", "height", "g")] == ["ms", "mm", "cm/s^2"]
    assert ds.fall_time.attrs["long_name"] == stones.fall_time.attrs["long_name"]
    xr.testing.assert_identical(ds.status.drop_vars(["height", "g"]), stones.status.drop_vars(["height", "g"]))
    assert stones.height.attrs["units"] == "m"


def test_all_mistakes_are_told_at_once(stones):
    with pytest.raises(StudyError) as caught:
        sweep.in_units(stones, {"fall_tim": "s", "height": "kg", "status": "1", "g": "parsec/furlong^"})
    text = str(caught.value)
    assert "4 mistakes" in text
    assert "did you mean fall_time?" in text
    assert '"kg" is a mass; height is a length' in text
    assert "words or counts" in text
