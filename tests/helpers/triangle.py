"""A right triangle by its legs: a kernel with every form of method and bound that the wiring makes columns of."""

import math
from typing import NamedTuple

import numpy as np

from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, OK
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit
from kernels.lanes.vectors import sqrt, where
from kernels.lanes.wiring import kernel, method, tracing
from kernels.maths.elementary import arctan


class Legs(NamedTuple):
    """Parameters."""

    a: float
    b: float


class Sides(NamedTuple):
    """Outputs about sides."""

    longest: float
    area: float


class Area(NamedTuple):
    """One output of the three."""

    area: float


class Triangle(NamedTuple):
    """All outputs: a record in a record, and in another order than that of the fields."""

    angle: float
    sides: Sides


@jit
def check(p):
    return where((p.a > 0.0) & (p.b > 0.0) & (p.a < math.inf) & (p.b < math.inf), OK, BAD_INPUT)  # NaN fails


@jit
def pythagoras(p, rtol):
    return Triangle(arctan(p.a / p.b), Sides(sqrt(p.a * p.a + p.b * p.b), 0.5 * p.a * p.b)), OK


@jit
def in_order(p, rtol):
    return (sqrt(p.a * p.a + p.b * p.b), 0.5 * p.a * p.b, arctan(p.a / p.b)), OK


@jit
def area_only(p, rtol):
    return (0.5 * p.a * p.b,), OK


@jit
def estimating(p, rtol):
    found, status = pythagoras(p, rtol)
    return found, error_of_each(p), status


@jit
def error_of_each(p):
    """The area's is a hundred times that of the longest side; that of the angle is no number where a > b."""
    return Triangle(where(p.a > p.b, math.nan, 1e-3), Sides(1e-9 * p.a, 1e-7 * p.a))


@jit
def error_of_the_area(p):
    return Area(1e-5 * p.b)


@jit
def memory():
    return (np.empty(2),)


@jit
def by_hand(i, columns, space):
    """One cell at a time, by way of a buffer."""
    space[0], space[1] = columns.a[i], columns.b[i]
    columns.longest[i] = math.sqrt(space[0] * space[0] + space[1] * space[1])
    columns.area[i] = 0.5 * space[0] * space[1]
    columns.angle[i] = arctan(space[0] / space[1])
    columns.status[i] = OK


FIELDS = {
    "parameters": (Field("a", "m", "leg"), Field("b", "m", "leg")),
    "outputs": (Field("longest", "m", "side"), Field("area", "m^2", "area"), Field("angle", "rad", "opposite of a")),
    "doc": "right triangle",
    "source": "Pythagoras",
    "check": check,
}

TRIANGLE = kernel(
    "triangle",
    **FIELDS,
    record=Legs,
    methods=(
        method("pythagoras", "records in a record", pythagoras, error_of_each),
        method("in_order", "a plain tuple", in_order, 1e-15),
        method("one_by_one", "the same, one cell at a time", in_order, loop=cell_by_cell),
        method("area_only", "lacks two outputs", area_only, error_of_the_area, lacks=("longest", "angle")),
        method("estimating", "says its error", estimating, estimates=True),
        tracing("by_hand", "writes its rows itself", by_hand, buffers=memory, loop=cell_by_cell),
    ),
)
