"""What every kernel of the catalogue keeps by every method, whatever its physics: see `kernels.interface`."""

import functools
import re
from typing import NamedTuple

import golden_columns as golden
import numpy as np
import pytest

import sweep
from kernels.catalogue import KERNELS, get
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import COMPILED

NAMES = sorted(KERNELS)
CELLS = 1000
DEAR = {
    "foliot": 300, "foliot_ripple": 100, "foliot_steps": 60, "foliot_noise": 200, "polisher_wear": 60,
    "polisher_wear_point": 60,
}  # fmt: skip
"""Cells of all of float64 where each takes long."""

compiled = pytest.mark.skipif(not COMPILED, reason="the digests hold plain Python to the bits of compiled cells")
ENDS = [0.0, 5e-324, 2.2e-308, 1e-160, 1.0, 1e160, 1.7e308, np.inf, -np.inf, np.nan, -0.0, -1.0]
KNOWN = [s for s in Status if s < Status.NOT_ASKED]


class Found(NamedTuple):
    """Cells, and {method: {what: column}} of those that the check lets pass."""

    cells: dict
    rtol: np.ndarray
    by: dict


def length_of(name):
    return golden.LENGTHS.get(name, (1,))[-1]


def methods_of(name):
    """All; of a scene of one's own the one that refills its lanes most unevenly."""
    kernel = golden.kernel_of(name)
    return kernel.methods if name in KERNELS else [kernel.method("taylor")]


def found_of(name, columns, rtol):
    """What becomes of the cells that the check lets pass."""
    kernel = golden.kernel_of(name)
    rows = np.delete(np.flatnonzero(golden.check_of(kernel, columns) == Status.OK), golden.TO_THE_LIMIT.get(name, ()))
    cells, rtol = golden.taken(columns, rows), rtol[rows]
    return Found(cells, rtol, {m.name: some_solved(kernel, m, cells, rtol) for m in methods_of(name)})


def some_solved(kernel, method, cells, rtol):
    """What a method gives; of one that takes thousands of steps in a tenth of the cells, others are NOT_ASKED."""
    rows = np.arange(rtol.size)[:: 10 if method.name in golden.THOUSANDS else 1]
    columns = {}
    for what, some in golden.solved(kernel, method, golden.taken(cells, rows), rtol[rows]).items():
        columns[what] = np.full((rtol.size, *some.shape[1:]), Status.NOT_ASKED if what == "status" else np.nan)
        columns[what] = columns[what].astype(some.dtype)
        columns[what][rows] = some
    return columns


@functools.cache
def usual(name):
    """Cells of `golden_columns`, a third of them where each takes long, and what becomes of them."""
    columns, rtol = golden.inputs(name, length_of(name))
    rows = np.arange(rtol.size)[:: 3 if name in DEAR else 1]
    return found_of(name, golden.taken(columns, rows), rtol[rows])


@functools.cache
def anywhere(name):
    """Cells near the example, of which most parameters have any bits of a float64, or extreme values."""
    near, rtol = golden.inputs(name, length_of(name))
    random, columns = np.random.default_rng(31), {}
    count = min(CELLS, DEAR.get(name, CELLS))
    rows = random.integers(0, golden.MANY[golden.NEAR], count)
    wild = random.choice([0.1, 0.4, 0.9], count)
    for field in get(name).parameters:
        column = near[field.name][rows]
        bits = random.integers(0, 2**63, column.shape, dtype=np.int64).view(float)
        bits = np.where(random.random(column.shape) < 0.2, random.choice(ENDS, column.shape), bits)
        bits = np.where((random.random(column.shape) < 0.5) & (field.lower < 0.0), -bits, bits)
        other = random.random(column.shape) < wild.reshape(-1, *(1 for _ in field.dims))
        bounded = field.integer and not field.choices  # a count of steps that a cell asks for, it gets
        columns[field.name] = column if bounded else np.where(other, bits, column)
    return columns, rtol[rows]


@pytest.mark.parametrize("name", [*KERNELS, *golden.SCENES])
def test_bits_are_those_that_are_kept(name):
    """After a change that is meant, golden_columns.py --write; the commit says so."""
    if name in ("sliding", "lag") and not COMPILED:
        pytest.skip("a single cell takes minutes as plain Python; rich has the same methods")
    assert not list(golden.differences([name], few=10))


@compiled
@pytest.mark.parametrize("name", [*NAMES, "rich"])
def test_a_cell_has_the_same_bits_alone_in_lanes_and_in_tails(name):
    """Alone, three together, in two groups of lanes in another order, and in a tail; beside refused cells, too."""
    found, kernel = usual(name), golden.kernel_of(name)
    for method in methods_of(name):
        there = np.flatnonzero(found.by[method.name]["status"] != Status.NOT_ASKED)
        many = np.resize(there[::-1], there.size if name in KERNELS else 131)  # a scene's lanes are refilled
        for order in (there[:1], there[-3:], many, np.random.default_rng(5).permutation(there)[:33]):
            again = golden.solved(kernel, method, golden.taken(found.cells, order), found.rtol[order])
            for what, column in again.items():
                assert not golden.difference(column, found.by[method.name][what][order]), (method.name, what)


def outside(kernel, columns):
    """Cells of which a value is none, infinite, or beyond the declared limits."""
    wrong = []
    for field in kernel.parameters:
        column = columns[field.name].reshape(len(columns[field.name]), -1)
        wrong.append((~(column >= field.lower) | ~(column <= field.upper) | np.isinf(column)).any(axis=1))
    return np.any(wrong, axis=0)


@pytest.mark.parametrize("name", NAMES)
def test_what_lies_outside_the_declared_limits_is_bad_input(name):
    """Each parameter in turn, and each place of an array; at a closed limit a cell is not refused for it."""
    kernel, example = get(name), golden.cell_of(name)
    for field in kernel.parameters:
        whole = field.choices or field.integer
        low, high = np.nextafter(field.lower, -np.inf), np.nextafter(field.upper, np.inf)
        refused = [np.nan, np.inf, -np.inf, low, high, *([field.lower + 0.5, field.lower + 1.5] if whole else [])]
        for place in np.ndindex(example[field.name].shape[1:]):
            columns = {key: np.repeat(column, len(refused) + 1, axis=0) for key, column in example.items()}
            columns[field.name][(slice(-1), *place)] = refused
            status = golden.check_of(kernel, columns)
            assert (status[:-1] == Status.BAD_INPUT).all(), (field.name, place, refused, status)
            assert status[-1] == Status.OK
        if np.isfinite(field.lower) and not field.dims:
            columns[field.name][:] = field.lower
            status = golden.check_of(kernel, columns)
            assert (status >= FIRST_REFUSAL if field.open_lower else status != Status.BAD_INPUT).all(), field.name
    columns, _ = anywhere(name)
    assert (golden.check_of(kernel, columns)[outside(kernel, columns)] == Status.BAD_INPUT).all()


@compiled
@pytest.mark.parametrize("name", NAMES)
def test_over_the_whole_of_float64_a_cell_is_right_or_refused(name):
    """What is OK is finite, and what several methods call right is the same within what they promise."""
    kernel = get(name)
    for found in (usual(name), found_of(name, *anywhere(name))):
        for method in kernel.methods:
            columns = found.by[method.name]
            assert np.isin(columns["status"], KNOWN).sum() == (columns["status"] != Status.NOT_ASKED).sum() > 0
            good = can(kernel, method, found) & (columns["status"] == Status.OK)
            if method.estimates:
                good &= columns["error"] <= found.rtol  # else the engine says INACCURATE
            for field in kernel.outputs:
                if field.name not in method.lacks and not field.gaps:
                    assert np.isfinite(columns[field.name][good]).all(), (method.name, field.name)
        agree(kernel, found)


def can(kernel, method, found):
    """Cells whose terms the method has."""
    able = np.ones(found.rtol.size, bool)
    for term in method.excludes:
        default = kernel.parameter(term).default
        able &= found.cells[term] == (found.cells[default] if isinstance(default, str) else default)
    return able


def promised(kernel, method, found):
    """What a method says that its values are right to: its bound, its estimate, or rtol; inf where not OK."""
    columns, rtol = found.by[method.name], found.rtol
    good = can(kernel, method, found) & (columns["status"] == Status.OK)
    if method.estimates:
        told = columns["error"]
    elif method.bound is not None:
        told = np.maximum(columns["bound"], rtol) if method.name == "map" else columns["bound"]  # it settles to rtol
    else:
        told = rtol
    if kernel.name in ESTIMATED:
        good &= told <= rtol
    return np.where(good & (told < 1.0), told, np.inf)


ESTIMATED = {"foliot_steps"}
"""Kernels whose bound is an estimate by runs at other steps: a promise only where a cell is OK by it."""


def agree(kernel, found):
    """Each method's outputs against those of the one that promises most, within what both promise."""
    told = {m.name: promised(kernel, m, found) for m in kernel.methods}
    for field in kernel.outputs:
        able = [m.name for m in kernel.methods if field.name not in m.lacks]
        if len(able) < 2 or field.of_method or not told[able[0]].size:
            continue
        best = np.argmin([told[name] for name in able], axis=0)
        values = np.array([found.by[name][field.name] for name in able])
        truth, of_truth = (
            np.take_along_axis(a, best.reshape(1, -1, *(1,) * (a.ndim - 2)), 0)[0]
            for a in (values, np.array([told[name] for name in able]))
        )
        size = np.abs(truth) if truth.ndim == 1 else np.abs(truth).max(axis=tuple(range(1, truth.ndim)), keepdims=True)
        for name, value in zip(able, values, strict=True):
            allowed = told[name] + of_truth + 4e-16
            sure = np.isfinite(allowed)
            shape = (-1, *(1,) * (truth.ndim - 1))
            with np.errstate(invalid="ignore", over="ignore"):
                wrong = np.abs(value - truth) > allowed.reshape(shape) * size
            wrong = (wrong & sure.reshape(shape)).reshape(len(wrong), -1).any(axis=1)
            cells = [{k: v[i] for k, v in found.cells.items()} for i in np.flatnonzero(wrong)[:2]]
            assert not wrong.any(), (name, field.name, wrong.sum(), cells, value[wrong][:2], truth[wrong][:2])


UNITS = {
    "s": (1, 0, 0, 0), "m": (0, 1, 0, 0), "kg": (0, 0, 1, 0), "rad": (0, 0, 0, 1), "N": (-2, 1, 1, 0),
    "Pa": (-2, -1, 1, 0), "Hz": (-1, 0, 0, 0), "day": (1, 0, 0, 0), "1": (0, 0, 0, 0),
}  # fmt: skip
FREE_ANGLES = {
    "foliot", "foliot_motion", "foliot_ripple", "foliot_start", "foliot_noise", "foliot_design", "foliot_steps",
    "balance", "balance_trace", "balance_driven",
}  # fmt: skip
"""Kernels whose motion has the same shape at any size of its angles, so that the radian is a unit as the others are;
but for that of `omega_n`, which is one of phase."""


CHANGES = (-6, 0, 0, 0), (4, 10, -8, 6)
"""Powers of two by which the units of time, length, mass and angle are changed."""


def dimension(unit):
    """Exponents of time, length, mass and angle."""
    total = np.zeros(4)
    above, _, below = unit.partition("/")
    for part, sign in ((above, 1), (below, -1)):
        for symbol, power in re.findall(r"([A-Za-z]+|1)(?:\^(\d+))?", part):
            total += sign * int(power or 1) * np.array(UNITS[symbol])
    return total


@compiled
@pytest.mark.parametrize("name", NAMES)
def test_units_scale_as_the_fields_declare(name):
    """Powers of two of time, length, mass and, where any will do, angle leave all bits but those of the exponent."""
    kernel, found = get(name), usual(name)
    rows = np.ones(found.rtol.size, bool)
    if "c" in found.cells:  # its unit hangs on the degree n: 1 for the degree 2 alone
        rows = found.cells["c"] == 0.0
    for field in kernel.parameters:
        column = np.abs(found.cells[field.name]).reshape(rows.size, -1)
        rows = rows & ((column == 0.0) | ((column > 1e-40) & (column < 1e40)) | (column == field.default)).all(axis=1)
    assert rows.any()
    cells, rtol = golden.taken(found.cells, rows), found.rtol[rows]
    for units in CHANGES:
        powers = np.array(units) * (1, 1, 1, name in FREE_ANGLES)

        def factor(field, powers=powers):
            return 2.0 ** float(dimension(field.unit) @ (powers * (1, 1, 1, field.name != "omega_n")))

        changed = {f.name: cells[f.name] * factor(f) for f in kernel.parameters}
        along = [values * factor(f) for f, values in zip(kernel.along, golden.along_of(kernel), strict=True)]
        for method in kernel.methods:
            there = found.by[method.name]["status"][rows] != Status.NOT_ASKED
            other = golden.solved(kernel, method, golden.taken(changed, there), rtol[there], along)
            here = {what: column[rows][there] for what, column in found.by[method.name].items()}
            assert (other["status"] == here["status"]).all(), method.name
            for field in (f for f in kernel.outputs if f.name != "amplitude_dB"):  # a logarithm
                back = other[field.name] / factor(field)
                assert not golden.difference(back, here[field.name]), (method.name, field.name, units)


@pytest.mark.parametrize("name", NAMES)
def test_the_example_runs_by_every_method_that_has_its_terms(name):
    kernel, columns = get(name), golden.cell_of(name)
    assert golden.check_of(kernel, columns)[0] == Status.OK
    for method in kernel.methods:
        if all(columns[term][0] == kernel.parameter(term).default for term in method.excludes):
            found = golden.solved(kernel, method, columns, np.array([1e-9]))
            assert found["status"][0] == Status.OK, method.name
            assert all(np.isnan(found[output]).all() for output in method.lacks)


@pytest.mark.parametrize("name", NAMES)
def test_everything_declared_is_named_once_and_told(name):
    kernel = get(name)
    assert kernel.name == name
    assert kernel.source
    assert all(m.doc for m in kernel.methods)
    fields = [*kernel.parameters, *kernel.outputs, *kernel.along]
    names = [f.name for f in fields]
    assert len(set(names)) == len(names)
    assert all(f.doc and f.unit for f in fields)
    arrays = {dim for p in kernel.parameters for dim in p.dims}
    assert all(len(p.dims) <= 1 for p in kernel.parameters)
    assert set(kernel.same_length.values()) <= arrays
    known = {c.name for c in kernel.along} | arrays | set(kernel.same_length)
    assert all(set(f.dims) <= known for f in kernel.outputs)


def test_status_numbers_fit_their_kind():
    assert all((s.kind in ("refused", "unsolved")) == (64 <= s < 125) for s in Status)
    assert all(s.doc for s in Status)
    assert max(Status) == Status.PENDING == 127


def run(kernel, outputs, rtol=1e-13):
    refused = set.intersection(*(set(method.excludes) for method in kernel.methods))
    columns = {name: values[:12] for name, values in golden.inputs(kernel.name)[0].items() if name not in refused}
    for field in kernel.parameters:
        if field.choices:
            words = {float(number): word for word, number in field.choices.items()}
            columns[field.name] = [words[value] for value in columns[field.name]]
    needed = {dim for field in kernel.outputs if field.name in outputs for dim in field.dims}
    along = zip(kernel.along, golden.along_of(kernel), strict=True)
    coordinates = {field.name: values for field, values in along if field.name in needed}
    keys = {"kernel": kernel.name, "outputs": outputs, "axes": columns, "along": coordinates}
    return sweep.run(**keys, design="zip", rtol=rtol, progress=False)


def rank(status):
    """0: right to rtol; 1: less is known; 2: refused."""
    return np.where(status >= FIRST_REFUSAL, 2, np.where(status == Status.INACCURATE, 1, 0))


@compiled
@pytest.mark.parametrize("name", NAMES)
def test_an_output_asked_for_alone_is_never_worse_off_than_with_others(name):
    kernel = get(name)
    names = [field.name for field in kernel.outputs]
    together = run(kernel, names)
    for output in names:
        alone = run(kernel, [output])
        assert (rank(alone.status.values) <= rank(together.status.values)).all(), output
        unbounded = [np.isposinf(ds.error_bound.values) for ds in (alone, together)]
        assert not (unbounded[0] & ~unbounded[1]).any(), output
