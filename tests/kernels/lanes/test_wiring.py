"""What `wiring` and `records` make of the physics of one cell: a right triangle, by every form of method and bound."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from columns import asked_for, bounds, solve
from numba.core.errors import TypingError

from kernels.interface import Field, Status
from kernels.lanes.codes import BAD_INPUT, OK
from kernels.lanes.columns import cell_by_cell
from kernels.lanes.jit import jit
from kernels.lanes.vectors import WIDTH, sqrt, where
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

OUTPUTS = ("longest", "area", "angle")
WHOLE = ("pythagoras", "in_order", "one_by_one", "estimating", "by_hand")
MANY = 2 * WIDTH + 5


def legs(n=MANY):
    random = np.random.default_rng(3)
    return random.uniform(0.1, 9.0, n), random.uniform(0.1, 9.0, n)


def triangle_by(function, *more, **options):
    return kernel("triangle", **FIELDS, methods=(method("strange", "", function, *more, **options),))


@pytest.mark.parametrize("name", WHOLE)
def test_each_output_goes_to_the_column_of_its_name(name):
    """With the same bits by every form of a method, and alone as among others."""
    a, b = legs()
    found, status = solve(TRIANGLE, name, a, b, rtol=math.inf)
    assert (status == Status.OK).all()
    np.testing.assert_allclose(found["longest"], np.hypot(a, b), rtol=1e-15)
    np.testing.assert_allclose(found["area"], a * b / 2, rtol=1e-15)
    np.testing.assert_allclose(found["angle"], np.arctan2(a, b), rtol=1e-15)
    plain = solve(TRIANGLE, "pythagoras", a, b)[0]
    for n in (1, 3, WIDTH - 1, WIDTH, WIDTH + 1, MANY):
        few = solve(TRIANGLE, name, a[-n:], b[-n:], rtol=math.inf)[0]
        assert all((few[output] == plain[output][-n:]).all() for output in OUTPUTS)


def test_no_cells_are_no_fault():
    assert solve(TRIANGLE, "pythagoras", np.empty(0), np.empty(0))[1].size == 0


def test_outputs_that_a_method_lacks_are_no_numbers():
    a, b = legs()
    found, _ = solve(TRIANGLE, "area_only", a, b)
    assert (found["area"] == 0.5 * a * b).all()
    assert np.isnan(found["longest"]).all()
    assert np.isnan(found["angle"]).all()


@pytest.mark.parametrize(
    ("name", "asked", "bound"),
    [
        ("pythagoras", ["longest"], 1e-9), ("pythagoras", ["area"], 1e-7), ("pythagoras", ["longest", "area"], 1e-7),
        ("pythagoras", ["angle"], 1e-3), ("pythagoras", None, 1e-3), ("pythagoras", [], 0.0),
        ("in_order", ["area"], 1e-15), ("area_only", ["area"], 2e-5),
    ],
)  # fmt: skip
def test_the_bound_is_the_worst_of_the_outputs_asked_for(name, asked, bound):
    assert bounds(TRIANGLE, name, [1.0, 1.0], 2.0, asked=asked).tolist() == [bound, bound]
    assert bounds(TRIANGLE, "pythagoras", [3.0], 2.0, asked=["angle"]).tolist() == [math.inf]  # of NaN


@pytest.mark.parametrize(("asked", "error"), [(["area"], 1e-7), (["longest"], 1e-9), (["angle"], math.inf)])
def test_a_method_that_estimates_tells_the_worst_error_of_those_asked_for(asked, error):
    columns = [np.array([1.0]), np.array([0.5])]
    outputs, found, status = [np.empty(1) for _ in OUTPUTS], np.empty(1), np.empty(1, np.int8)
    estimating = TRIANGLE.method("estimating")
    assert estimating.estimates
    estimating.solve(*columns, np.array([1e-9]), asked_for(TRIANGLE, asked), *outputs, found, status)
    assert found.tolist() == [error]


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
        solve(strange, "strange", *legs(3))


def test_a_bound_that_forgets_an_output_is_refused():
    """For it would count as exact."""
    strange = triangle_by(in_order, jit(lambda p: Area(p.a)))
    with pytest.raises(REFUSED):
        bounds(strange, "strange", *legs(3))


def test_a_record_that_has_not_the_parameters_in_their_order_is_refused():
    with pytest.raises(TypeError, match=r"triangle.*'b', 'a'"):
        kernel("triangle", **FIELDS, record=Swapped, methods=())
    with pytest.raises(TypeError, match="the record has"):
        kernel("triangle", **FIELDS, record=check, methods=())


@pytest.mark.parametrize("options", [{"lacks": ("weight",)}, {"excludes": ("weight",)}])
def test_what_there_is_not_can_be_neither_lacked_nor_excluded(options):
    with pytest.raises(TypeError, match=r"triangle\.strange .*weight"):
        triangle_by(pythagoras, **options)
