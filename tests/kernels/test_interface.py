"""Every kernel keeps the contract that the engine relies on."""

import inspect
import math

import numpy as np
import pytest
from columns import checked, solve

from kernels.catalogue import KERNELS, get
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

NAMES = sorted(KERNELS)
REMARKED_ONLY = {"polisher": {"theta_lock", "theta_lock_outer"}}
"""Outputs that exist only where a remark says so: NaN in a scene that runs well."""
SHORTER = {"polisher_wear_point": {"tau": 1.0}, "foliot_noise": {"half_swings": 40.0, "averaging_time": 20.0}}
"""Of examples, that take minutes in plain Python."""


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


def refusals(kernel, name, value):
    """The status of the kernel's example with another value of one parameter, or of the first of an array's."""
    if kernel.parameter(name).dims:
        given = kernel.example.get(name, (kernel.parameter(name).default,) * array_length(kernel))
        value = [value, *given[1:]]
    return checked(kernel, **{k: [v] for k, v in (dict(kernel.example) | {name: value}).items()})[0]


def array_length(kernel):
    return next(np.size(kernel.example[p.name]) for p in kernel.parameters if p.dims and p.name in kernel.example)


@pytest.mark.parametrize("name", NAMES)
def test_just_what_lies_outside_the_declared_limits_is_bad_input(name):
    kernel = get(name)
    for field in kernel.parameters:
        for value in (np.nan, np.inf, -np.inf, np.nextafter(field.lower, -np.inf), np.nextafter(field.upper, np.inf)):
            assert refusals(kernel, field.name, value) == Status.BAD_INPUT, (field.name, value)
        if np.isfinite(field.lower):
            at_limit = refusals(kernel, field.name, field.lower)
            assert at_limit >= FIRST_REFUSAL if field.open_lower else at_limit != Status.BAD_INPUT, field.name


def around(kernel, count, spread):
    """Cells around the kernel's example: words at random, whole numbers a few more, others times a random factor."""
    rng = np.random.default_rng(11)
    example = {**kernel.example, **SHORTER.get(kernel.name, {})}
    cells = {}
    for field in kernel.parameters:
        usual = np.asarray(example.get(field.name, field.default if not isinstance(field.default, str) else math.nan))
        if field.choices:
            cells[field.name] = rng.choice([float(v) for v in field.choices.values()], count)
        elif field.integer:
            cells[field.name] = usual + rng.integers(0, 4, count)
        elif field.name in example:
            cells[field.name] = np.clip(
                usual * np.exp(spread * rng.normal(size=(count, *usual.shape))), field.lower, field.upper
            )
    return cells


@pytest.mark.parametrize("spread", [0.1, 1.0])
@pytest.mark.parametrize("name", NAMES)
def test_what_is_ok_is_finite_but_for_what_may_have_gaps(name, spread):
    """The engine asks it of the kernels of others only: of ours, it would cost the cheapest a tenth of their time."""
    kernel = get(name)
    cells = around(kernel, 40 if COMPILED else 2, spread)
    good = checked(kernel, **cells) == Status.OK
    along = [np.arange(1.0, 6.0) if field.integer else np.linspace(0.0, 1.0, 5) for field in kernel.along]
    for method in kernel.methods:
        given = {n: v[good] for n, v in cells.items() if n not in method.excludes}
        outputs, status = solve(kernel, method.name, along=along, **given)
        for field in kernel.outputs:
            if field.name not in method.lacks and not field.gaps:
                assert np.isfinite(outputs[field.name][status == Status.OK]).all(), (method.name, field.name)


@pytest.mark.parametrize("name", NAMES)
def test_the_example_of_every_kernel_runs(name):
    kernel = get(name)
    example = kernel.example | (SHORTER.get(name, {}) if not COMPILED else {})
    cell = {name: [value] for name, value in example.items()}
    along = [np.arange(1.0, 6.0) if field.integer else np.linspace(0.0, 1.0, 5) for field in kernel.along]
    assert checked(kernel, **cell)[0] == Status.OK
    for method in kernel.methods:
        if any(cell[term] != [kernel.parameter(term).default] for term in method.excludes if term in cell):
            continue  # it cannot do a term of the example
        absent = {*method.lacks, *REMARKED_ONLY.get(name, ())}
        given = {o.name for o in kernel.outputs} - absent
        outputs, status = solve(kernel, method.name, along=along, **cell)
        assert status[0] == Status.OK
        assert all(np.isfinite(outputs[o]).all() for o in given)
        assert all(np.isnan(outputs[o]).all() for o in absent)
