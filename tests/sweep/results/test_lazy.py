"""An unfinished sweep that is read when it is used gives the same numbers as one that is read at once."""

import numpy as np
import pytest
import toy_studies
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from running import interrupted, keys

import sweep
from sweep.results import open
from sweep.store import parts

SIZES = {"v0": 3, "height": 11, "phase": 3}


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The sweep as it is read at once, and when it is used."""
    path = tmp_path_factory.mktemp("unfinished") / "out.h5"
    axes = {"v0": [0.0, 2.0, 3.0], "height": np.arange(1.0, 12)}
    study = toy_studies.build(axes=axes, outputs=["fall_time", "drop"], along={"phase": [0.0, 0.5, 1.0]})
    interrupted(study, path)
    with pytest.MonkeyPatch.context() as patch:
        at_once = sweep.open_result(path)
        patch.setattr(open, "LARGEST_AT_ONCE", 0)
        patch.setattr(parts, "AT_ONCE", 2)
        yield at_once, sweep.open_result(path)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(key=st.fixed_dictionaries({}, optional={name: keys(size) for name, size in SIZES.items()}))
def test_any_piece_of_it_is_the_same(both, key):
    at_once, lazily = (found.isel(key) for found in both)
    for name in at_once.data_vars:
        assert lazily[name].dims == at_once[name].dims
        assert lazily[name].values.tobytes() == at_once[name].values.tobytes()


def test_cells_that_follow_each_other_are_read_without_a_list_of_their_numbers(both, monkeypatch):
    monkeypatch.setattr(parts.Parts, "read", None)
    at_once, lazily = both
    for key in ({}, {"v0": 1}, {"v0": slice(1, 3)}, {"v0": 2, "height": slice(3, 9)}, {"v0": 0, "height": 4}):
        for name in at_once.data_vars:
            assert lazily[name].isel(key).values.tobytes() == at_once[name].isel(key).values.tobytes()
