"""Outputs asked for one at a time: nobody pays for what was not asked for."""

import numpy as np
import pytest
from golden_columns import along_of, inputs

import sweep
from kernels import catalogue
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

CELLS, RTOL = 12, 1e-13


def _run(kernel, outputs, rtol):
    refused = set.intersection(*(set(method.excludes) for method in kernel.methods))
    columns = {name: values[:CELLS] for name, values in inputs(kernel.name)[0].items() if name not in refused}
    for field in kernel.parameters:
        if field.choices:
            words = {float(number): word for word, number in field.choices.items()}
            columns[field.name] = [words[value] for value in columns[field.name]]
    needed = {dim for field in kernel.outputs if field.name in outputs for dim in field.dims}
    along = zip(kernel.along, along_of(kernel), strict=True)
    coordinates = {field.name: values for field, values in along if field.name in needed}
    keys = {"kernel": kernel.name, "outputs": outputs, "axes": columns, "along": coordinates}
    return sweep.run(**keys, design="zip", rtol=rtol, progress=False)


def _rank(status):
    """0: right to rtol; 1: less is known; 2: refused."""
    return np.where(status >= FIRST_REFUSAL, 2, np.where(status == Status.INACCURATE, 1, 0))


@pytest.mark.skipif(not COMPILED, reason="through the engine")
@pytest.mark.parametrize("name", sorted(catalogue.KERNELS))
def test_an_output_asked_for_alone_is_never_worse_off_than_with_others(name):
    kernel = catalogue.get(name)
    names = [field.name for field in kernel.outputs]
    together = _run(kernel, names, RTOL)
    for output in names:
        alone = _run(kernel, [output], RTOL)
        assert (_rank(alone.status.values) <= _rank(together.status.values)).all(), output
        unbounded = [np.isposinf(ds.error_bound.values) for ds in (alone, together)]
        assert not (unbounded[0] & ~unbounded[1]).any(), output
