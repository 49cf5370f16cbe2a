"""A result of three by four cells that no study made, as small as one can be: its structure, and its numbers."""

import os

import numpy as np

from sweep.cells.grid import Box
from sweep.cells.partition import Partition
from sweep.cells.schema import Column, Coordinate, Schema
from sweep.store.ending import end
from sweep.store.frame import ENDINGS, Frame
from sweep.store.layout import write_digests
from sweep.store.structure import Cut

MARK = {"study": "abc"}
TEXTS = {name: "x" * length for name, length in ENDINGS.items()}
SCHEMA = Schema(
    Box(("u", "v"), (3, 4)),
    (
        Column("x", "<f8", ("m",), (2,), {"units": "s"}),
        Column("status", "i1", (), (), {"long_name": "what became of the cell"}),
    ),
    (
        Coordinate("u", ("u",), np.array([1.0, 2.0, 4.0]), {"units": "m"}),
        Coordinate("v", ("v",), np.array(["a", "bb", "ccc", "d"]), {}),
        Coordinate("pair", ("u", "v"), np.arange(12.0).reshape(3, 4), {}),
        Coordinate("m", ("m",), np.array([7, 8]), {}),
        Coordinate("mass", ("m",), np.array([0.5, 0.25]), {"units": "kg"}),
        Coordinate("edge", ("w",), np.array([1.0, 2.0, 3.0]), {}),
        Coordinate("g", (), np.float64(9.5), {"units": "m/s^2"}),
    ),
    {"title": "by hand"},
)


def cut(cells=4):
    """Its blocks of so many cells: a row of four, or a part of one, or all."""
    return Cut(SCHEMA.columns, (3, 4), Partition(12, cells, 12 if cells >= 4 else 4))


def rows_cut(count=5, cells=2):
    """What a summary is made of."""
    return Cut((Column("n", "i8", ("k",), (3,), {}), Column("y", "<f8", (), (), {})), (count,), Partition(count, cells))


def frame(cells=4, shared=False, **more):
    return Frame(SCHEMA, {"cells": cut(cells), **more}, MARK, "now", shared)


def numbers(table, block):
    """What stands in a block: in every cell and place of a column another number."""
    start, stop = table.blocks.bounds(block)
    return {p.name: whole(table, p)[start:stop] for p in table.places}


def whole(table, place):
    """All cells of a column."""
    cells = table.blocks.size
    return (1 + np.arange(cells * int(np.prod(place.shape)), dtype=place.dtype)).reshape(cells, *place.shape)


def written(path, made=None, blocks=None, name="cells"):
    """Writes a frame and some of its blocks, by default all; gives the layout."""
    made = made or frame()
    fd = os.open(path, os.O_CREAT | os.O_TRUNC | os.O_RDWR)
    made.write(fd)
    fill(fd, made.layout.tables[name], blocks)
    os.close(fd)
    return made.layout


def finished(path, made=None, ended=True):
    """Writes a frame, all of its blocks, and what ends it."""
    layout = written(path, made)
    with path.open("r+b") as file:
        if ended:
            end(file.fileno(), layout, TEXTS)
    return layout


def fill(fd, table, blocks=None):
    blocks = range(table.blocks.count) if blocks is None else blocks
    write_digests(fd, table, {block: table.write(fd, block, numbers(table, block)) for block in blocks})


def harm(path, at, bit=1):
    """Changes a byte."""
    content = bytearray(path.read_bytes())
    content[at] ^= bit
    path.write_bytes(content)
