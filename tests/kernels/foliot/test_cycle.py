"""The viscous foliot against 50 digits, against waiting for the cycle, and against its own laws."""

import numpy as np
import oracles
import pytest
from columns import bounds, relative_error, solve
from mpmath import mpf

from kernels.foliot.cycle import FOLIOT
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

NAMES = ("period", "amplitude", "crossing_speed", "sensitivity", "multiplier")
SOME = 400 if COMPILED else 12


def scenes(low, high, n=SOME, seed=1):
    """mu, phi0, a of random foliots with log10(alpha) between `low` and `high`."""
    random = np.random.default_rng(seed)
    alpha = 10 ** random.uniform(low, high, n)
    a, phi0 = 10 ** random.uniform(-3, 3, n), 10 ** random.uniform(-2, 2, n)
    return alpha * a * a * phi0, phi0, a


def errors(outputs, columns, names=NAMES):
    truths = [oracles.foliot(*cell) for cell in zip(*columns, strict=True)]
    return {name: relative_error(outputs[name], [t[NAMES.index(name)] for t in truths]) for name in names}


SPANS = {
    "closed": [(-30, -12), (-12, -2), (-2, 0.155), (0.15, 0.16), (0.155, 2), (2, 30)],
    "asymptotic": [(-12, -1), (-1, 1.5), (1.5, 12)],
}


@pytest.mark.parametrize(("method", "span"), [(method, span) for method, spans in SPANS.items() for span in spans])
def test_formulas_are_right_to_their_bounds_over_decades(method, span):
    columns = scenes(*span)
    outputs, status = solve(FOLIOT, method, *columns)
    assert (status == Status.OK).all()
    found = errors(outputs, columns)
    found["multiplier"][outputs["multiplier"] < 1e-300] = 0.0  # 0 for good
    for name, error in found.items():
        promise = bounds(FOLIOT, method, *columns, asked=[name])
        assert (error <= promise).all(), (name, [float(c[(error - promise).argmax()]) for c in columns])
        closed = (promise == (2e-15 if name == "multiplier" else 1e-15)).all()
        assert closed if method == "closed" else promise.max() < 0.2


@pytest.mark.parametrize("rtol", [1e-4, 1e-9, 1e-12])
def test_the_iterated_map_is_right_to_rtol_or_says_that_it_has_not_settled(rtol):
    columns = scenes(-6, 9 if COMPILED else 2, n=SOME // 2)
    outputs, status = solve(FOLIOT, "map", *columns, rtol=rtol)
    good = (status == Status.OK) & (bounds(FOLIOT, "map", *columns) <= rtol)
    assert set(status) <= {Status.OK, Status.NOT_CONVERGED}
    assert good.mean() > 0.5
    kept = [c[good] for c in columns]
    for name, error in errors({n: v[good] for n, v in outputs.items()}, kept).items():
        error[outputs["multiplier"][good] < 1e-300] *= name != "multiplier"
        assert error.max() <= rtol, name


EDGES = [
    (1e-200, 1e100, 1e-150), (1e-150, 1e-300, 1e75), (3e250, 1e250, 2.0), (1e-290, 1e-290, 1.0), (1e-310, 1.0, 1e-155),
    (1.0, 1e-120, 1e60), (1.7e308, 1.7e308, 1.0), (1e300, 1e-300, 1e300), (1e70, 1e60, 1e150), (1.0, 1.0, 1e-155),
    (1.0, 1.0, 1e-160), (1e10, 1.0, 1e-150), (1e300, 1e-10, 1.0),
    (4e-308, 1e308, 2e-308),  # only the period is too large
    (1e-300, 1e-300, 1e10),  # only the speed is too small
]  # fmt: skip
"""mu, phi0 and a at which a product on the way, or an output, is no float64."""


@pytest.mark.parametrize("method", ["closed", "asymptotic", "map"] if COMPILED else ["closed"])
def test_over_the_whole_range_of_float64_a_cell_is_right_or_refused(method):
    random = np.random.default_rng(11)
    mu, phi0, a = (10 ** random.uniform(-307, 307, SOME) for _ in range(3))
    edges = np.array(EDGES)
    near = np.array([[1.0, 1.0, 2.0**e] for e in (-241, -240, -239, 239, 240, 241, -511, 511)])
    columns = np.concatenate([np.stack([mu, phi0, a], axis=1), edges, near]).T
    outputs, status = solve(FOLIOT, method, *columns, rtol=1e-9)
    good = status == Status.OK
    kept = [c[good] for c in columns]
    limit = np.maximum(bounds(FOLIOT, method, *kept, asked=NAMES[:4]), 1e-9 if method == "map" else 0.0)
    for name, error in errors({n: v[good] for n, v in outputs.items()}, kept, NAMES[:4]).items():
        assert (error <= limit).all(), (name, [float(c[(error / limit).argmax()]) for c in kept])
    assert np.array([np.isfinite(v[good]) for v in outputs.values()]).all()
    for cell in columns.T[status == Status.OUT_OF_RANGE][-50:]:
        assert not 2.3e-308 < mpf(cell[2]) ** 2 * mpf(cell[1]) / mpf(cell[0]) < mpf("1.79e308"), cell
    for i in np.flatnonzero(status == Status.PARTLY_OUT_OF_RANGE)[-50:]:
        truth = oracles.foliot(*columns[:, i])
        promise = max(1e-9, bounds(FOLIOT, method, *columns[:, i : i + 1], asked=NAMES[:3])[0])
        for name, true in zip(NAMES[:3], truth, strict=False):
            missing = not 2.3e-308 < true < mpf("1.79e308")
            assert np.isnan(outputs[name][i]) == missing, (name, columns[:, i])
            assert missing or relative_error(outputs[name][i : i + 1], [true])[0] <= promise
