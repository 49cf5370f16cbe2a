"""The half swing of `_half_swing` as scenes of one's own: from x = 1 with the speed v0 up to x = -1.

The two tangents go along as states; of them `up_mu` and `up_start` keep the speeds that they have at the turning point.
A form follows what its cells need: with drag of any degree; without, where the friction's slope is a constant; and for
a search of the speed, which needs no tangent, for dF/dv1 is known from `decay` and `top`.
"""

import functools
from collections import namedtuple

import numpy as np

from kernels.codegen.compiled import runner
from kernels.codegen.followed import followed
from kernels.expression.graph import cos, power, sign, sin
from kernels.scene import Scene

Swung = namedtuple("Swung", "time x v x_mu v_mu x_start v_start decay top up_mu up_start")
"""What a half swing comes to: its time, and states at the switch."""

STATES = Swung._fields[1:]
TERMS = ("drag", "outwards", "inwards", "gamma", "degree", "kappa")
RIPPLE = ("depth", "wave")
_UNKNOWN = {"x_mu": np.nan, "v_mu": np.nan, "up_mu": np.nan}
_FIRST = {"x": 1.0, "v_start": 1.0, "top": 1.0, "up_start": 1.0}


def _rates(x, v, x_mu, v_mu, x_start, v_start, drag, outwards, inwards, gamma, degree, kappa, torque=1.0, by_x=0.0):
    """(1) of `_half_swing` with its tangents; `torque` and its slope where it varies."""
    side = sign(v)
    rising, falling = 0.5 * (1.0 + side), 0.5 * (1.0 - side)
    slope, stiffness = drag + degree * gamma * power(abs(v), degree - 1.0), kappa + by_x
    steady = rising * outwards + falling * inwards + (torque - 1.0)
    force = steady + drag * v + side * gamma * power(abs(v), degree) + kappa * x
    by_mu = -torque - stiffness * x_mu - slope * v_mu
    by_start = -stiffness * x_start - slope * v_start
    return v, -force, v_mu, by_mu, v_start, by_start, slope, rising * v, rising * by_mu, rising * by_start


def smooth_rates(x, v, x_mu, v_mu, x_start, v_start, drag, outwards, inwards, gamma, degree, kappa):
    return _rates(x, v, x_mu, v_mu, x_start, v_start, drag, outwards, inwards, gamma, degree, kappa)


def rippled_rates(x, v, x_mu, v_mu, x_start, v_start, drag, outwards, inwards, gamma, degree, kappa, depth, wave):
    angle = wave * (1.0 - x)
    torque, by_x = 1.0 + depth * cos(angle), depth * wave * sin(angle)
    return _rates(x, v, x_mu, v_mu, x_start, v_start, drag, outwards, inwards, gamma, degree, kappa, torque, by_x)


def searched_rates(x, v, drag, outwards, inwards, kappa, depth, wave):
    rising, falling = 0.5 * (1.0 + sign(v)), 0.5 * (1.0 - sign(v))
    steady = rising * outwards + falling * inwards
    return v, -(steady + drag * v + kappa * x + depth * cos(wave * (1.0 - x))), rising * v


def linear_rates(x, v, x_mu, v_mu, x_start, v_start, drag, outwards, inwards, kappa, depth, wave):
    rising, angle = 0.5 * (1.0 + sign(v)), wave * (1.0 - x)
    stiffness = kappa + depth * wave * sin(angle)
    by_mu = -1.0 - depth * cos(angle) - stiffness * x_mu - drag * v_mu
    by_start = -stiffness * x_start - drag * v_start
    x_rate, v_rate, top_rate = searched_rates(x, v, drag, outwards, inwards, kappa, depth, wave)
    return x_rate, v_rate, v_mu, by_mu, v_start, by_start, top_rate, rising * by_mu, rising * by_start


Form = namedtuple("Form", "name states terms rates")
"""A scene, which follows some of `STATES` by some of the terms."""

_LINEAR = ("drag", "outwards", "inwards", "kappa", *RIPPLE)
SMOOTH = Form("foliot_swing", STATES, TERMS, smooth_rates)
RIPPLED = Form("foliot_ripple_swing", STATES, (*TERMS, *RIPPLE), rippled_rates)
LINEAR = Form("foliot_ripple_linear", tuple(s for s in STATES if s != "decay"), _LINEAR, linear_rates)
SEARCHED = Form("foliot_ripple_search", ("x", "v", "top"), _LINEAR, searched_rates)


@functools.cache
def _runner(form):
    """The compiled half swing."""

    def surface(x):
        return x + 1.0

    def start(v0):
        return tuple(v0 if name == "v" else _FIRST.get(name, 0.0) for name in form.states)

    terms = (*form.terms, "v0")
    scene = Scene(form.name, "half swing of a foliot", form.states, terms, form.rates, surface, start, most_kinks=1)
    return runner(scene, "taylor")


def half_swings(form, columns, tolerance):
    """The half swings of cells, rows of a `Swung` and of statuses, from columns: the form's terms, v0, and 1.

    Tangents that the form does not follow are NaN by mu, so that the sensitivity is none; by v0 they are 0, which
    takes from time and amplitude what Newton's last step would better.
    """
    rows = followed(_runner(form), columns, tolerance)
    found = dict(zip(("time", "interval", *form.states), rows, strict=False))
    if "decay" not in found:
        found["decay"] = columns[form.terms.index("drag")] * found["time"]
    nothing = {name: np.full(len(tolerance), _UNKNOWN.get(name, 0.0)) for name in Swung._fields}
    return np.array([*((nothing | found)[name] for name in Swung._fields), rows[-1]])
