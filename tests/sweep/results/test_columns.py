"""Any piece of a result, finished or not, is the piece of all of it, however its blocks are cut."""

import numpy as np
import pytest
import toy_studies
from hypothesis import given, settings
from hypothesis import strategies as st
from running import interrupted, keys, quiet

import sweep

SIZES = {"v0": 3, "height": 11, "phase": 3}


def study():
    axes = {"v0": [0.0, 2.0, 3.0], "height": np.arange(1.0, 12)}
    return toy_studies.build(axes=axes, outputs=["fall_time", "drop"], along={"phase": [0.0, 0.5, 1.0]})


@pytest.fixture(scope="module", params=["unfinished", 1, 4, 11, 22, 33])
def both(request, tmp_path_factory):
    """A result in memory, and the same that is read when it is used."""
    path = tmp_path_factory.mktemp("result") / "out.h5"
    if request.param == "unfinished":
        interrupted(study(), path)
    else:
        quiet(study(), path, block_cells=request.param).close()
    with sweep.open_result(path) as whole:
        whole.load()
    with sweep.open_result(path) as lazily:
        yield whole, lazily


@settings(max_examples=60, deadline=None)
@given(key=st.fixed_dictionaries({}, optional={name: keys(size) for name, size in SIZES.items()}))
def test_any_piece_of_it_is_the_same(both, key):
    at_once, lazily = (found.isel(key) for found in both)
    for name in at_once.data_vars:
        assert lazily[name].dims == at_once[name].dims
        assert lazily[name].values.tobytes() == at_once[name].values.tobytes()
