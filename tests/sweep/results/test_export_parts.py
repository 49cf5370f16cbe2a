"""Parts of an export: limits of float32, blocks of rows, columns of a summary."""

import numpy as np
import pytest
import xarray as xr

from sweep.results import export as export_module
from sweep.system.errors import SweepError


@pytest.mark.parametrize("value", [3.4028234e38, -3.4028234e38, 1.17549435e-38, 0.0, np.inf, np.nan])
def test_float32_holds_its_own_limits(value):
    assert export_module._single("y", np.array([value])).tolist() == pytest.approx([value], nan_ok=True)


@pytest.mark.parametrize("value", [3.5e38, -3.5e38, 1.1754942e-38, -1e-40, 1e-300])
def test_float32_does_not_hold_what_is_beyond(value):
    with pytest.raises(SweepError, match=r"^y: float32 cannot hold .*; export it in float64$"):
        export_module._single("y", np.array([1.0, value]))


@pytest.mark.parametrize("rows", [1, 2, 3, 5, 6, 7, 11, 12, 13, 24, 99])
def test_blocks_are_all_cells_in_order_and_no_larger_than_said(monkeypatch, rows):
    monkeypatch.setattr(export_module, "ROWS", rows)
    ds = xr.Dataset(
        {"y": (("a", "b", "c"), np.arange(24.0).reshape(4, 2, 3)), "status": (("a", "b"), np.zeros((4, 2)))}
    )
    blocks = list(export_module._blocks(ds))
    assert [v for block in blocks for v in block.y.values.ravel()] == list(range(24))
    assert max(block.y.size for block in blocks) == {1: 1, 2: 2, 3: 3, 5: 3, 6: 6, 7: 6, 11: 6, 12: 12, 13: 12}.get(
        rows, 24
    )


def test_bins_of_a_summary_are_columns_named_by_their_ends():
    columns = {
        "cells_by_status": (("a", "status_name"), [[1, 0], [2, 0]]),
        "cells_by_method": (("a", "method_name"), [[1], [2]]),
        "y_histogram": (("a", "y_bin"), [[1, 2], [3, 4]], {"long_name": "cells in bins"}),
        "y_min": ("a", [0.1, 0.2]),
    }
    coords = {
        "a": [5.0, 6.0], "status_name": ["OK", "FAILED"], "method_name": ["map"],
        "y_bin_lower": ("y_bin", [0.5, 1.0]), "y_bin_upper": ("y_bin", [1.0, 2.5]),
    }  # fmt: skip
    found = export_module.flat(xr.Dataset(columns, coords, {"kernel": "toy"}))
    assert list(found.data_vars) == ["cells_OK", "cells_map", "y_histogram_1", "y_histogram_2", "y_min"]
    assert found.y_histogram_2.values.tolist() == [2, 4]
    assert found.y_histogram_2.attrs["long_name"] == "1 to 2.5: cells in bins"
    assert found.cells_OK.attrs["long_name"] == "cells: OK"
    assert (list(found.coords), found.attrs) == (["a"], {"kernel": "toy"})
