"""Every kernel keeps the contract that the engine relies on."""

import inspect

import pytest

from kernels.catalogue import KERNELS, get
from kernels.interface import Status

NAMES = sorted(KERNELS)


@pytest.mark.parametrize("name", NAMES)
def test_functions_take_the_columns_they_declare(name):
    kernel = get(name)
    parameters = [p.name for p in kernel.parameters]
    along, outputs = [f.name for f in kernel.along], [o.name for o in kernel.outputs]
    assert list(inspect.signature(kernel.check).parameters) == [*parameters, "status"]
    for method in kernel.methods:
        asked, error = (["asked"], ["error"]) if method.estimates else ([], [])
        columns = [*parameters, "rtol", *along, *asked, *outputs, *error, "status"]
        assert list(inspect.signature(method.solve).parameters) == columns
        if method.bound:
            assert list(inspect.signature(method.bound).parameters) == [*parameters, "rtol", *along, "asked", "out"]


@pytest.mark.parametrize("name", NAMES)
def test_everything_declared_is_named_once_and_told(name):
    kernel = get(name)
    assert kernel.name == name
    fields = [*kernel.parameters, *kernel.outputs, *kernel.along]
    names = [f.name for f in fields]
    assert len(set(names)) == len(names)
    assert all(f.doc and f.unit for f in fields)
    arrays = {dim for p in kernel.parameters for dim in p.dims}
    assert all(len(p.dims) <= 1 for p in kernel.parameters)
    assert set(kernel.same_length.values()) <= arrays
    known = {c.name for c in kernel.along} | arrays | set(kernel.same_length)
    assert all(set(f.dims) <= known for f in kernel.outputs)
    assert kernel.source
    assert all(m.doc for m in kernel.methods)


def test_status_numbers_fit_their_kind():
    assert all((s.kind in ("refused", "unsolved")) == (64 <= s < 125) for s in Status)
    assert all(s.doc for s in Status)
    assert max(Status) == Status.PENDING == 127
