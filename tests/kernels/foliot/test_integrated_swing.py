"""The integrated half swing against two oracles, every term of the friction, and what it must refuse."""

import foliot_oracles
import numpy as np
import oracles
import pytest
from columns import relative_error
from loops import each_cell

from kernels.foliot._integrated_swing import SMOOTH, dopri5
from kernels.foliot._units import Scene
from kernels.interface import Status
from kernels.lanes.columns import entry
from kernels.lanes.jit import COMPILED, jit

NAMES = ("half period", "amplitude", "speed", "sensitivity", "multiplier")
TERMS = {"d": 0.0, "rho": 0.0, "rho_s": None, "gamma": 0.0, "n": 1.0, "kappa": 0.0, "e": 1.0}


@jit
def _cell(i, d, rho, rho_s, gamma, n, kappa, e, rtol, half_period, amplitude, speed, sensitivity, multiplier, status):
    scene = Scene(d[i], rho[i], rho_s[i], gamma[i], n[i], kappa[i], e[i], 1.0 - rho[i])
    cycle, verdict = dopri5(scene, SMOOTH, rtol[i])
    half_period[i], amplitude[i], speed[i], sensitivity[i], multiplier[i] = cycle
    status[i] = verdict


@entry()
def integrate(d, rho, rho_s, gamma, n, kappa, e, rtol, half_period, amplitude, speed, sensitivity, multiplier, status):
    each_cell(
        _cell,
        (d, rho, rho_s, gamma, n, kappa, e, rtol, half_period, amplitude, speed, sensitivity, multiplier, status),
    )


def run(rtol, **terms):
    """Outputs by name, and status, of cells without dimensions."""
    values = TERMS | terms
    values["rho_s"] = values["rho"] if values["rho_s"] is None else values["rho_s"]
    n = max(np.size(v) for v in (*values.values(), rtol))
    columns = [np.array(np.broadcast_to(np.asarray(v, float), n)) for v in (*values.values(), rtol)]
    outputs, status = [np.full(n, np.nan) for _ in NAMES], np.full(n, 99, np.int8)
    integrate(*columns, *outputs, status)
    return dict(zip(NAMES, outputs, strict=True)), status


def as_columns(cells):
    return {name: np.array([TERMS[name] if name not in c else c[name] for c in cells], float) for name in cells[0]}


FULL = {name: value for name, value in TERMS.items() if name != "rho_s"}
CELLS = [
    FULL | cell
    for cell in (
        {"d": 0.01},
        {"d": 3.0, "rho": 0.9},
        {"d": 50.0, "rho": 0.3},
        {"rho": 0.999},
        {"rho": 0.1, "e": 0.3},
        {"gamma": 0.3, "n": 0.0},
        {"gamma": 1.5, "n": 0.5},
        {"gamma": 0.4, "n": 0.5, "d": 6.0, "rho": 0.7, "e": -0.9},
        {"gamma": 4.0, "n": 1.5},
        {"gamma": 2.0, "n": 1.0, "d": 1.0, "rho": 0.2},
        {"gamma": 5.0, "n": 2.0, "e": 0.5},
        {"gamma": 0.1, "n": 2.5, "d": 0.1},
        {"gamma": 0.01, "n": 3.0, "rho": 0.1},
        {"gamma": 8.0, "n": 4.0, "e": 0.0},
        {"d": 0.3, "kappa": 5.0},
        {"d": 0.01, "kappa": 300.0, "rho": 0.3},
        {"rho": 0.8, "kappa": 1000.0},
        {"kappa": 50.0, "e": 0.9},
        {"kappa": 50.0, "e": -0.5},
        {"d": 0.1, "kappa": 2.0, "rho": 0.2, "e": 0.0},
    )
]


@pytest.fixture(scope="module")
def truths():
    """Of `CELLS`; and half periods, as the cells have no dimensions."""
    cells = CELLS if COMPILED else [CELLS[i] for i in (5, 10, 12, 14)]
    found = []
    for cell in cells:
        terms = {
            ours: cell[name] for ours, name in zip("aRcnke", ("d", "rho", "gamma", "n", "kappa", "e"), strict=True)
        }
        period, *rest = foliot_oracles.cycle(1.0, 1.0, **terms, digits=18)
        found.append((period / 2, *rest))
    return cells, found


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9] if COMPILED else [1e-3])
def test_every_term_and_their_mixtures_are_right_to_half_of_rtol(rtol, truths):
    cells, truth = truths
    outputs, status = run(rtol, **as_columns(cells))
    assert (status == Status.OK).all(), [c for c, s in zip(cells, status, strict=True) if s]
    for j, name in enumerate(NAMES):
        kept = [i for i, t in enumerate(truth) if abs(t[j]) > 1e-300]
        error = relative_error(outputs[name][kept], [truth[i][j] for i in kept])
        assert error.max() <= 0.5 * rtol, (name, cells[kept[error.argmax()]], error.max() / rtol)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9] if COMPILED else [1e-3])
def test_viscous_friction_over_eight_decades_is_right_to_half_of_rtol(rtol):
    d = np.sqrt(np.geomspace(1e-4, 1e4, 300 if COMPILED else 3))
    outputs, status = run(rtol, d=d)
    assert (status == Status.OK).all()
    truth = [oracles.foliot(1.0, 1.0, value) for value in d]
    for j, name in enumerate(NAMES):
        kept = [i for i, t in enumerate(truth) if t[j] > 1e-300]
        error = relative_error(outputs[name][kept], [truth[i][j] / (2 if j == 0 else 1) for i in kept])
        assert error.max() <= 0.5 * rtol, (name, d[kept[error.argmax()]], error.max() / rtol)


def test_restitution_alone_follows_its_closed_law():
    e = np.array([-0.9, -0.3, 0.0, 0.2, 0.7, 0.99] if COMPILED else [-0.3, 0.7])
    outputs, status = run(1e-9, e=e)
    assert (status == Status.OK).all()
    assert np.allclose(outputs["half period"], 2 * np.sqrt((1 + e) / (1 - e)), rtol=1e-9)
    assert np.allclose(outputs["amplitude"], np.where(e > 0, (1 + e * e) / (1 - e * e), 1.0), rtol=1e-9)
    assert np.allclose(outputs["sensitivity"], 0.5, rtol=1e-9)
    assert np.allclose(outputs["multiplier"], e * e, rtol=1e-9)


def test_where_a_swing_from_rest_cannot_reach_the_switch_there_is_no_cycle():
    cells = [
        FULL | cell
        for cell in (
            {"d": 3.0, "kappa": 10.0},  # overdamped: creeps to the spring's rest
            {"d": 0.5, "kappa": 100.0},  # falls short by energy
            {"gamma": 3.0, "n": 2.0, "kappa": 50.0},
            {"rho": 1.0},
            {"rho": 0.5, "gamma": 0.5, "n": 0.0},
            {"d": 0.1, "rho": 0.9, "kappa": 30.0},
        )
    ]
    _, status = run(1e-6 if COMPILED else 1e-3, **as_columns(cells))
    assert (status == Status.STICKS).all(), status


def test_the_last_spring_that_is_overcome_and_the_first_that_is_not():
    cells = [FULL | {"d": 0.5, "kappa": kappa} for kappa in (6.0, 6.6)]
    with pytest.raises(foliot_oracles.NoCycle):
        foliot_oracles.cycle(1.0, 1.0, a=0.5, k=6.6, digits=15)
    foliot_oracles.cycle(1.0, 1.0, a=0.5, k=6.0, digits=15)
    _, status = run(1e-6, **as_columns(cells))
    assert status.tolist() == [Status.OK, Status.STICKS]


def test_stiction_holds_a_turning_point_that_the_spring_does_not_free():
    rho_s = np.array([0.9, 1.5, 1.5, 1.5])
    e = np.array([1.0, 1.0, 1.0, -0.5])  # the last does not turn
    _, status = run(1e-6, rho=0.5, rho_s=rho_s, kappa=np.array([0.0, 0.0, 10.0, 0.0]), e=e)
    assert status.tolist() == [Status.OK, Status.STICKS, Status.OK, Status.OK]


def test_what_is_too_stiff_is_refused():
    _, status = run(1e-3, d=np.array([2e3, 101.0]), kappa=np.array([0.0, 1e-3]))
    assert (status == Status.STEP_LIMIT).all()


@pytest.mark.skipif(not COMPILED, reason="thousands of steps in plain Python")
def test_what_rounding_spoils_is_remarked():
    _, status = run(1e-9, rho=0.1492, kappa=77.15)
    assert status[0] == Status.INACCURATE


@pytest.mark.skipif(not COMPILED, reason="sixty half swings at the finest tolerance in plain Python")
@pytest.mark.parametrize("rtol", [np.nan, -1.0])
def test_a_senseless_rtol_is_never_met(rtol):
    _, status = run(rtol, d=1.0)
    assert status[0] != Status.OK
