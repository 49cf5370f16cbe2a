"""What `wiring` and `records` make of errors and bounds of one cell, a right triangle, and what they refuse.

Where outputs go, and by each form of method, digests of all kernels and their oracles tell.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest
from columns import asked_for, bounds, solve
from numba.core.errors import TypingError

from kernels.interface import Field
from kernels.lanes.codes import BAD_INPUT, OK
from kernels.lanes.jit import jit
from kernels.lanes.vectors import sqrt, where
from kernels.lanes.wiring import kernel, method
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
def estimating(p, rtol):
    found, status = pythagoras(p, rtol)
    return found, error_of_each(p), status


@jit
def error_of_each(p):
    """The area's is a hundred times that of the longest side; that of the angle is no number where a > b."""
    return Triangle(where(p.a > p.b, math.nan, 1e-3), Sides(1e-9 * p.a, 1e-7 * p.a))


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
        method("estimating", "says its error", estimating, estimates=True),
    ),
)

LEGS = [3.0], [4.0]


def triangle_by(function, *more, **options):
    return kernel("triangle", **FIELDS, methods=(method("strange", "", function, *more, **options),))


@pytest.mark.parametrize(
    ("asked", "bound"),
    [(["longest"], 1e-9), (["area"], 1e-7), (["longest", "area"], 1e-7), (["angle"], 1e-3), (None, 1e-3), ([], 0.0)],
)
def test_the_bound_is_the_worst_of_the_outputs_asked_for(asked, bound):
    assert bounds(TRIANGLE, "pythagoras", [1.0, 1.0], 2.0, asked=asked).tolist() == [bound, bound]
    assert bounds(TRIANGLE, "pythagoras", [3.0], 2.0, asked=["angle"]).tolist() == [math.inf]  # of NaN


@pytest.mark.parametrize(("asked", "error"), [(["area"], 1e-7), (["longest"], 1e-9), (["angle"], math.inf)])
def test_a_method_that_estimates_tells_the_worst_error_of_those_asked_for(asked, error):
    columns = [np.array([1.0]), np.array([0.5])]
    outputs, found, status = [np.empty(1) for _ in range(3)], np.empty(1), np.empty(1, np.int8)
    estimating = TRIANGLE.method("estimating")
    assert estimating.estimates
    estimating.solve(*columns, np.array([1e-9]), asked_for(TRIANGLE, asked), *outputs, found, status)
    assert found.tolist() == [error]
    assert np.ravel(outputs).tolist() == pytest.approx([math.hypot(1.0, 0.5), 0.25, math.atan2(1.0, 0.5)])


class Swapped(NamedTuple):
    b: float
    a: float


class Weight(NamedTuple):
    longest: float
    area: float
    weight: float


REFUSED = (TypingError, TypeError, AttributeError)


@pytest.mark.parametrize(
    "function",
    [
        lambda p, rtol: (Area(p.a), OK), lambda p, rtol: (Weight(p.a, p.a, p.a), OK), lambda p, rtol: (p.a, OK),
        lambda p, rtol: ((p.a, p.height, p.b), OK),
    ],
)  # fmt: skip
def test_outputs_that_do_not_fit_the_fields_are_refused(function):
    strange = triangle_by(jit(function))
    with pytest.raises(REFUSED):
        solve(strange, "strange", *LEGS)


def test_a_bound_that_forgets_an_output_is_refused():
    """For it would count as exact."""
    strange = triangle_by(pythagoras, jit(lambda p: Area(p.a)))
    with pytest.raises(REFUSED):
        bounds(strange, "strange", *LEGS)


def test_a_record_that_has_not_the_parameters_in_their_order_is_refused():
    with pytest.raises(TypeError, match=r"triangle.*'b', 'a'"):
        kernel("triangle", **FIELDS, record=Swapped, methods=())
    with pytest.raises(TypeError, match="the record has"):
        kernel("triangle", **FIELDS, record=check, methods=())


@pytest.mark.parametrize("options", [{"lacks": ("weight",)}, {"excludes": ("weight",)}])
def test_what_there_is_not_can_be_neither_lacked_nor_excluded(options):
    with pytest.raises(TypeError, match=r"triangle\.strange .*weight"):
        triangle_by(pythagoras, **options)
