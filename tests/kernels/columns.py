"""Columns for tests of kernels."""

import numpy as np
from mpmath import mp, mpf

from kernels.interface import Kernel


def columns_of(kernel: Kernel, parameters, named):
    """One column per parameter of the kernel: the first ones in order, others by name, the rest at their defaults."""
    values = {p.name: p.default for p in kernel.parameters}
    values |= dict(zip(values, parameters, strict=False)) | named
    cells = np.broadcast_shapes(*(np.shape(v) for v in values.values() if not isinstance(v, str)))
    values = {name: values[v] if isinstance(v, str) else v for name, v in values.items()}
    return [np.array(np.broadcast_to(np.asarray(v, float), cells)) for v in values.values()]


def solve(kernel: Kernel, method: str, *parameters, rtol=1e-9, along=(), **named):
    """Outputs by name, and status, of one method; nothing is checked before or filled after."""
    columns = columns_of(kernel, parameters, named)
    n = len(columns[0])
    lengths = {field.name: len(values) for field, values in zip(kernel.along, along, strict=True)}
    outputs = {f.name: np.full((n, *(lengths[d] for d in f.dims)), np.nan) for f in kernel.outputs}
    status = np.full(n, 99, np.int8)
    tolerances = np.ascontiguousarray(np.broadcast_to(np.asarray(rtol, float), (n,)))
    kernel.method(method).solve(*columns, tolerances, *along, *outputs.values(), status)
    return outputs, status


def bounds(kernel: Kernel, method: str, *parameters, asked=None, rtol=1e-9, along=(), **named):
    """The error bound of one method for every cell."""
    columns = columns_of(kernel, parameters, named)
    out = np.full(len(columns[0]), np.nan)
    asked = np.array([f.name in (asked or [o.name for o in kernel.outputs]) for f in kernel.outputs], np.uint8)
    kernel.method(method).bound(*columns, np.full(len(out), rtol), *along, asked, out)
    return out


def checked(kernel: Kernel, *parameters, **named):
    """The status that `check` gives every cell."""
    columns = columns_of(kernel, parameters, named)
    status = np.full(len(columns[0]), 99, np.int8)
    kernel.check(*columns, status)
    return status


def relative_error(values, truths):
    """abs(value/truth - 1), each taken in high precision."""
    with mp.workdps(60):
        return np.array([float(abs(mpf(float(v)) / t - 1)) for v, t in zip(values, truths, strict=True)])
