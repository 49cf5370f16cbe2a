"""Loops over columns of cells, and the entry functions that the engine calls."""

import functools
import inspect

import numpy as np

from kernels.lanes.jit import COMPILED, cached, jit, jit_entry
from kernels.lanes.vectors import WIDTH, lanes_at


def entry(*shared):
    """Makes a function of columns one that the engine can call; its machine code is kept on the disk.

    Columns hold one cell a row; those named in `shared` belong to all cells. Fewer cells than lanes are filled up with
    copies of the last one, so that no second version for one cell is compiled.
    """

    def decorate(function):
        per_cell = [name not in shared for name in inspect.signature(function).parameters]
        return functools.wraps(function)(entry_of(function, per_cell, kept=True)) if COMPILED else function

    return decorate


_ROWS = np.minimum.outer(np.arange(WIDTH), np.arange(WIDTH))
"""Of so many cells and one more, the cell in each lane."""


def _filled_up(compiled, columns, per_cell, read):
    n = len(columns[0])
    rows = _ROWS[n - 1]
    full = [c[rows] if cells else c for c, cells in zip(columns, per_cell, strict=True)]
    compiled(*full)
    for column, result in zip(columns[read:], full[read:], strict=True):
        if column is not result and column.flags.writeable:
            column[...] = result[:n]


def _looped(index, width):
    """A loop that calls a body with the index of so many cells at a time; the last ones once more beside others."""

    @jit
    def loop(body, columns, buffers):
        n = columns[0].shape[0]
        for i in range(0, n, width):
            body(index(min(i, n - width)), columns, *buffers)

    return loop


def _plain(body, columns, buffers):
    with np.errstate(all="ignore"):
        for i in range(columns[0].shape[0]):
            body(i, columns, *buffers)


in_lanes = _looped(lanes_at, WIDTH) if COMPILED else _plain
cell_by_cell = _looped(np.int64, 1) if COMPILED else _plain
in_groups = _looped(np.int64, WIDTH) if COMPILED else _plain


def entry_of(function, per_cell, kept, read=0):
    """An entry of columns. `per_cell` says which hold one cell a row (None: few cells need no filling up).

    The first `read` columns are only read.
    """
    if not COMPILED:
        return function
    compiled = cached(function) if kept else jit_entry(function)

    def call(*columns):
        if per_cell is None:
            compiled(*(c if c.flags.writeable else c.copy() for c in columns))
        elif 0 < len(columns[0]) < WIDTH:
            _filled_up(compiled, columns, per_cell, read)
        elif len(columns[0]):
            compiled(*columns)

    call.compiled = compiled
    return call
