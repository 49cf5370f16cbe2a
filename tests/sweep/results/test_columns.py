"""Any piece of a result, finished or not, is the piece of all of it, however its blocks are cut."""

import math
import random

import numpy as np
import pytest
import toy_studies
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from running import interrupted, keys, quiet

import sweep
from sweep.store import reading
from sweep.store.reading import runs

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


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    key=st.fixed_dictionaries({}, optional={name: keys(size) for name, size in SIZES.items()}),
    short=st.sampled_from([1, 3, 64]),
)
def test_any_piece_of_it_is_the_same(both, monkeypatch, key, short):
    monkeypatch.setattr(reading, "SHORT_RUN", short)
    at_once, lazily = (found.isel(key) for found in both)
    for name in at_once.data_vars:
        assert lazily[name].dims == at_once[name].dims
        assert lazily[name].values.tobytes() == at_once[name].values.tobytes()


def test_several_threads_read_the_same(both, monkeypatch):
    monkeypatch.setattr(reading, "LONG_RUN", 1)
    whole, lazily = both
    for name in whole.data_vars:
        assert lazily[name][1:].values.tobytes() == whole[name][1:].values.tobytes()


def test_runs_are_the_cells_of_a_key_in_their_order():
    rng = random.Random(5)
    for _ in range(300):
        grid = tuple(rng.randint(1, 5) for _ in range(rng.randint(0, 4)))
        key = tuple(rng.choice([rng.randrange(n), slice(None), slice(rng.randrange(n), n), slice(None, None, 2),
                                slice(None, None, -1)]) for n in grid)  # fmt: skip
        starts, length = runs(key, grid)
        found = (starts[:, None] + np.arange(length)).ravel()
        assert found.tolist() == np.arange(math.prod(grid)).reshape(grid)[key].ravel().tolist()


def test_a_block_is_read_once_for_many_runs_in_it(tmp_path, monkeypatch):
    path = tmp_path / "out.h5"
    quiet(study(), path, block_cells=33).close()
    real, calls = reading.Table.read, []
    monkeypatch.setattr(reading.Table, "read", lambda self, *rest: (calls.append(rest), real(self, *rest))[1])
    monkeypatch.setattr(reading, "SHORT_RUN", 1)
    with sweep.open_result(path) as found:
        assert found.fall_time[:, 2:5].values.shape == (3, 3)
    assert len(calls) == 1
