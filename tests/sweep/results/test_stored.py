"""What `sweep run` reads from a file it has just written, without xarray."""

import numpy as np
import pytest
from toy_studies import build

import sweep
from sweep.results import statuses
from sweep.results.open import open_result
from sweep.results.statuses import account, count_statuses, summary_text
from sweep.results.stored import Stored

HEIGHTS = [1.0, -1.0, np.nan, 4.0, 9.0, 16.0]
STUDIES = {
    "product": {"axes": {"height": HEIGHTS, "v0": [0.0, 1.0, np.nan]}},
    "words": {"axes": {"height": HEIGHTS, "method": ["rough", "exact", "auto"]}},
    "zip": {"axes": {"height": HEIGHTS, "v0": [1.0, 0.0, 1.0, 0.0, 1.0, 0.0]}, "design": "zip"},
    "one cell": {"axes": {"height": [-1.0]}},
    "summary": {"axes": {"height": HEIGHTS, "v0": [0.0, 1.0, np.nan]}, "summary": {"outputs": {"fall_time": ["min"]}}},
    "summary of one axis": {
        "axes": {"height": HEIGHTS, "v0": [0.0, 1.0]},
        "summary": {"outputs": {"fall_time": ["mean"]}, "over": ["v0"]},
    },
}


@pytest.mark.parametrize("at_once", [1, 2, 5, 1 << 22])
@pytest.mark.parametrize("name", STUDIES)
def test_a_file_tells_the_same_of_its_cells_without_xarray(tmp_path, monkeypatch, name, at_once):
    monkeypatch.setattr(statuses, "CELLS_AT_ONCE", at_once)
    study, output = build(outputs=["fall_time"], **STUDIES[name]), tmp_path / "out.h5"
    sweep.run(study, output, progress=False).close()
    with Stored(output, study) as found, open_result(output) as dataset:
        assert summary_text(found) == summary_text(dataset)
        assert count_statuses(found) == count_statuses(dataset)
        assert account(found).refused > 0
