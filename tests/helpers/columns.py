"""Columns for tests of kernels."""

import functools

import numpy as np
from mpmath import mp, mpf

from kernels.interface import FIRST_REFUSAL, Field, Kernel, Status

JUNK = -7.5
"""What stands in an output before a method writes it."""


def fields(*names):
    """Declarations of numbers without a unit."""
    return tuple(Field(name, "1", name) for name in names)


def columns_of(kernel: Kernel, parameters, named):
    """One column per parameter of the kernel: the first ones in order, others by name, the rest at their defaults.

    Array parameters have the shape (length,) or (n_cells, length).
    """
    values = {p.name: p.default for p in kernel.parameters}
    values |= dict(zip(values, parameters, strict=False)) | named
    values = {name: values[v] if isinstance(v, str) else v for name, v in values.items()}
    given = [(np.asarray(values[p.name], float), bool(p.dims)) for p in kernel.parameters]
    cells = np.broadcast_shapes(*(v.shape[:-1] if array else v.shape for v, array in given))
    length = max((v.shape[-1] for v, array in given if array and v.ndim), default=0)
    return [np.array(np.broadcast_to(v, (*cells, length) if array else cells)) for v, array in given]


def named(kernel: Kernel, cells):
    """{parameter: column} of cells that are dicts; what a cell leaves out is at its default."""
    names = [p for p in kernel.parameters if any(p.name in cell for cell in cells)]
    return {p.name: np.array([cell.get(p.name, p.default) for cell in cells], float) for p in names}


def solve(kernel: Kernel, method: str, *parameters, rtol=1e-9, along=(), asked=None, **named):
    """Outputs by name, and status, of one method; nothing is checked before or filled after."""
    return estimated(kernel, method, *parameters, rtol=rtol, along=along, asked=asked, **named)[:2]


def estimated(kernel: Kernel, method: str, *parameters, rtol=1e-9, along=(), asked=None, **named):
    """The same, and the error that the method estimates for the outputs asked for (None: all), NaN if it does not."""
    columns = columns_of(kernel, parameters, named)
    tolerances = np.ascontiguousarray(np.broadcast_to(np.asarray(rtol, float), (len(columns[0]),)))
    outputs, status, error = called(kernel, method, columns, tolerances, along, asked)
    if kernel.method(method).estimates:
        status[~(error <= tolerances) & (status < FIRST_REFUSAL) & (status != Status.GRAZING)] = Status.INACCURATE
    return outputs, status, error


def called(kernel: Kernel, method: str, columns, rtol, along, asked):
    """Outputs by name, NaN where the cell is refused, status and error as the method writes them, over junk."""
    outputs = {name: np.full_like(none, JUNK) for name, none in unwritten(kernel, columns, along).items()}
    status, error = np.full(rtol.size, 99, np.int8), np.full(rtol.size, np.nan)
    before, after = ([asked_for(kernel, asked)], [error]) if kernel.method(method).estimates else ([], [])
    kernel.method(method).solve(*columns, rtol, *along, *before, *outputs.values(), *after, status)
    for values in outputs.values():
        values[status >= FIRST_REFUSAL] = np.nan
    return outputs, status, error


def unwritten(kernel: Kernel, columns, along):
    """Outputs by name, NaN, of cells with these columns."""
    lengths = {field.name: len(values) for field, values in zip(kernel.along, along, strict=True)}
    lengths |= {d: c.shape[1] for p, c in zip(kernel.parameters, columns, strict=True) for d in p.dims}
    lengths |= {dim: lengths[other] for dim, other in kernel.same_length.items()}
    return {f.name: np.full((len(columns[0]), *(lengths[d] for d in f.dims)), np.nan) for f in kernel.outputs}


def asked_for(kernel: Kernel, names):
    """1 for the outputs of these names; None: for all."""
    return np.array([names is None or f.name in names for f in kernel.outputs], np.uint8)


def bounds(kernel: Kernel, method: str, *parameters, asked=None, rtol=1e-9, along=(), **named):
    """The error bound of one method for every cell."""
    columns = columns_of(kernel, parameters, named)
    out = np.full(len(columns[0]), np.nan)
    kernel.method(method).bound(*columns, np.full(len(out), rtol), *along, asked_for(kernel, asked), out)
    return out


def checked(kernel: Kernel, *parameters, **named):
    """The status that `check` gives every cell."""
    columns = columns_of(kernel, parameters, named)
    status = np.full(len(columns[0]), 99, np.int8)
    kernel.check(*columns, status)
    return status


def counted(function):
    """The function with an attribute `calls`: how often it has been called."""

    @functools.wraps(function)
    def call(*values, **named):
        call.calls += 1
        return function(*values, **named)

    call.calls = 0
    return call


def relative_error(values, truths):
    """abs(value/truth - 1), each taken in high precision."""
    with mp.workdps(60):
        return np.array([float(abs(mpf(float(v)) / t - 1)) for v, t in zip(values, truths, strict=True)])
