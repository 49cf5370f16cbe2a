"""Columns of cells for every kernel, the same on every machine, and digests of the bits of all that comes out.

python tests/helpers/golden_columns.py [KERNEL ...] > before.json
"""

import hashlib
import json
import sys

import numpy as np

from kernels import catalogue

CELLS = 70
"""Two groups of lanes and a tail."""
RTOL = 1e-9


def _spread(random, shape):
    """Numbers of 1/4 to 4 whose every bit is the generator's own: no library's pow is asked."""
    return np.ldexp(random.uniform(1.0, 2.0, shape), random.integers(-2, 2, shape))


def _lengths(kernel):
    """The length that the example's arrays have."""
    return {
        field.dims[0]: len(kernel.example[field.name])
        for field in kernel.parameters
        if field.dims and field.name in kernel.example
    }


def _column(field, example, lengths, columns, random):
    shape = (CELLS, *(lengths[d] for d in field.dims))
    typical = example.get(field.name, field.default)
    if isinstance(typical, str):
        return columns[typical] * np.ldexp(1.0, random.integers(0, 2, shape))
    if field.choices:
        return random.choice(np.array(list(field.choices.values()), np.float64), shape)
    scale = np.asarray(typical, np.float64) if typical else 1.0
    values = scale * _spread(random, shape)
    if not typical:
        values = np.where(random.random(shape) < 0.5, 0.0 if typical is None else typical, values)
    if field.integer:
        values = np.rint(values)
    return np.clip(values, field.lower, field.upper) * np.ones(shape)


def inputs(kernel):
    """One column a parameter."""
    random, columns = np.random.default_rng(11), {}
    for field in kernel.parameters:
        columns[field.name] = np.ascontiguousarray(_column(field, kernel.example, _lengths(kernel), columns, random))
    return columns


def along(field):
    """A few values of a coordinate."""
    if field.integer:
        return np.arange(max(field.lower, 0.0), max(field.lower, 0.0) + 5.0)
    high = field.upper if np.isfinite(field.upper) else 20.0
    return np.linspace(max(field.lower, 0.0), high, 7)


def _digest(*arrays):
    found = hashlib.sha256()
    for array in arrays:
        # every NaN is the same NaN
        found.update(np.where(np.isnan(array), np.nan, array).tobytes() if array.dtype.kind == "f" else array.tobytes())
    return found.hexdigest()[:16]


def digests(name):
    """{what: digest} of the check, and of each method's outputs, status and bound."""
    kernel = catalogue.get(name)
    columns = list(inputs(kernel).values())
    status = np.zeros(CELLS, np.int8)
    kernel.check(*columns, status)
    found = {"check": _digest(status)}
    sound = status < 64
    cells = [np.ascontiguousarray(column[sound]) for column in columns]
    rtol, coordinates = np.full(sound.sum(), RTOL), [along(field) for field in kernel.along]
    for method in kernel.methods:
        found[method.name] = _digest(*_solved(kernel, method, cells, rtol, coordinates))
        if method.bound is not None:
            asked, out = np.ones(len(kernel.outputs), np.uint8), np.empty(rtol.size)
            method.bound(*cells, rtol, *coordinates, asked, out)
            found[f"{method.name} bound"] = _digest(out)
    return found


def _solved(kernel, method, cells, rtol, coordinates):
    """Every output, NaN where the cell is refused, and the status."""
    lengths = _lengths(kernel) | {field.name: c.size for field, c in zip(kernel.along, coordinates, strict=True)}
    lengths |= {new: lengths[old] for new, old in kernel.same_length.items()}
    outputs = [np.zeros((rtol.size, *(lengths[d] for d in field.dims))) for field in kernel.outputs]
    status = np.zeros(rtol.size, np.int8)
    asked = [np.ones(len(outputs), np.uint8)] if method.estimates else []
    error = [np.zeros(rtol.size)] if method.estimates else []
    method.solve(*cells, rtol, *coordinates, *asked, *outputs, *error, status)
    for column in (*outputs, *error):
        column[status >= 64] = np.nan
    return *outputs, *error, status


if __name__ == "__main__":
    json.dump({name: digests(name) for name in sys.argv[1:] or sorted(catalogue.KERNELS)}, sys.stdout, indent=1)
    print()
