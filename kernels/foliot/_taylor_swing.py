"""The half swing of the general foliot by Taylor series: a scene of one's own, for `_limit_cycle`.

The half swing of `_half_swing`, equation (1) there, is a scene of one's own, from x = 1 with the speed v0 to x = -1,
with a kink at the turning point. The series, the proof that no event is passed over, and the core of abs(v)^n are those
of `kernels.codegen`. The two tangents go along as states; of them `up_mu` and `up_start` keep the speeds that they have
at the turning point, where they should jump by J of (3). That they do not is made good for at the end: what is wanting
is a multiple of the tangent along the motion itself, (v, v'), with the factor
    beta = (J - 1) v_mu/v'  at the turning point,                                                        (1)
which is what dry friction's change of sign shifts the time by.
A form of the scene follows what its cells need: with drag of any degree; without, where the friction's slope is a
constant; and for a search of the speed, which needs no tangent, for dF/dv1 is known from `decay` and `top`. The rough
one of two half swings has parameters some roundings off, as in `to_tolerance`.
"""

import functools
from collections import namedtuple

import numpy as np

from kernels.codegen.compiled import runner
from kernels.codegen.followed import followed, off_by_roundings
from kernels.codegen.to_tolerance import FINER
from kernels.expression.graph import cos, power, sign, sin
from kernels.foliot._half_swing import Half, inwards, problem_of, pull, rates
from kernels.foliot._limit_cycle import ROUGH, Cell, Found, Manner, Terms, found_by, of_columns
from kernels.foliot._units import Outputs, without_dimensions
from kernels.interface import FIRST_REFUSAL, Status
from kernels.lanes.jit import jit
from kernels.lanes.vectors import where
from kernels.lanes.wiring import signed
from kernels.maths.elementary import exp
from kernels.scene import Scene

_STIFFEST, _MILDEST = 100.0, 1.0
"""f'(V)/V above which steps that are stable are too short; degree of drag below which its slope has a pole at rest,
which series come close to slowly."""

Swung = namedtuple("Swung", "time x v x_mu v_mu x_start v_start decay top up_mu up_start")
"""What a half swing comes to: its time, and states at the switch."""
TERMS, RIPPLE = Terms._fields[:6], ("depth", "wave")
Form = namedtuple("Form", "name states terms")
"""A scene of a half swing, which follows some of its states by some of the terms."""
SMOOTH = Form("foliot_swing", Swung._fields[1:], TERMS)
RIPPLED = Form("foliot_ripple_swing", SMOOTH.states, (*TERMS, *RIPPLE))
_BARE = tuple(name for name in RIPPLED.terms if name not in ("gamma", "degree"))
LINEAR = Form("foliot_ripple_linear", tuple(name for name in SMOOTH.states if name != "decay"), _BARE)
SEARCHED = Form("foliot_ripple_search", ("x", "v", "top"), _BARE)
FORMS = SMOOTH, RIPPLED, LINEAR, SEARCHED
_UNKNOWN = {"x_mu": np.nan, "v_mu": np.nan, "up_mu": np.nan}
_FIRST = {"x": 1.0, "v_start": 1.0, "top": 1.0, "up_start": 1.0}


@functools.cache
def _runner(form):
    """The compiled half swing by (1) of `_half_swing`, with its tangents and the states at the turning point."""
    dragged, varies = "gamma" in form.terms, "wave" in form.terms

    def rates_of_named(**p):
        x, v, drag, kappa = p["x"], p["v"], p["drag"], p["kappa"]
        side = sign(v)
        rising, falling = 0.5 * (1.0 + side), 0.5 * (1.0 - side)
        steady, slope = rising * p["outwards"] + falling * p["inwards"], drag
        angle = p["wave"] * (1.0 - x) if varies else None
        extra = p["depth"] * cos(angle) if varies else 0.0
        if dragged:
            gamma, degree, speed = p["gamma"], p["degree"], abs(v)
            slope = drag + degree * gamma * power(speed, degree - 1.0)
            force = steady + ((1.0 + extra) - 1.0) + drag * v + side * gamma * power(speed, degree) + kappa * x
        else:
            force = steady + drag * v + kappa * x + extra
        found = {"x": v, "v": -force, "top": rising * v, "decay": slope}
        if "x_mu" in p:
            stiffness = kappa + p["depth"] * p["wave"] * sin(angle) if varies else kappa
            pushed = -(1.0 + extra) if dragged else -1.0 - extra
            by_mu = pushed - stiffness * p["x_mu"] - slope * p["v_mu"]
            by_start = -stiffness * p["x_start"] - slope * p["v_start"]
            found |= {"x_mu": p["v_mu"], "v_mu": by_mu, "x_start": p["v_start"], "v_start": by_start}
            found |= {"up_mu": rising * by_mu, "up_start": rising * by_start}
        return tuple(found[name] for name in form.states)

    def surface(x):
        return x + 1.0

    def start(v0):
        return tuple(v0 if name == "v" else _FIRST.get(name, 0.0) for name in form.states)

    terms = (*form.terms, "v0")
    functions = signed(rates_of_named, [*form.states, *form.terms]), surface, start
    return runner(Scene(form.name, "half swing of a foliot", form.states, terms, *functions, most_kinks=1), "taylor")


@jit
def taylor(p, rtol):
    """What a half swing comes to that followed the speed v1, with (1) made good for; of the terms of `_half_swing`,
    with friction of any degree as it is down to rest."""
    scene, units = without_dimensions(p)
    problem = problem_of(scene, (p.depth, p.harmonic), 0.0 * p.e)
    e, v, force = problem.e, p.v, pull(p.top, problem)
    behind = problem.inwards + force
    jump = where(e > 0.0, behind / (problem.outwards + force), 1.0)
    shift = (1.0 - jump) / behind
    by_mu, by_start = shift * p.up_mu, shift * p.up_start
    rate = rates((p.x, v, p.x_mu, p.v_mu, p.x_start, p.v_start, p.decay), inwards(problem, problem.floor))[1]
    x_mu, v_mu, x_start, v_start = p.x_mu + by_mu * v, p.v_mu + by_mu * rate, p.x_start + by_start * v, p.v_start
    state, never = (p.x, v, x_mu, v_mu, x_start, v_start + by_start * rate, p.decay), e > 2.0
    half = Half(-v, state, rate, p.top, p.time, jump * exp(-p.decay), never, never)
    return found_by(units, problem, p.v1, half)


_found = of_columns(taylor, (*Cell._fields, "v1", *Swung._fields), (*Found._fields[:-1], *Outputs._fields))


def follow(s, bare):
    """Half swings of cells, as `Manner` says; NaN where one comes to rest on its way.

    Tangents that a form does not follow are NaN by mu, so that the sensitivity is none; by v0 they are 0.
    """
    known = s._asdict() | {"wave": s.harmonic * (0.5 * np.pi)}
    varies, dragged = s.depth > 0.0, s.gamma > 0.0
    form = np.where(varies, np.where(dragged, FORMS.index(RIPPLED), FORMS.index(LINEAR) + bare), FORMS.index(SMOOTH))
    swung, kind = Swung(*np.empty((len(Swung._fields), len(s.v)))), 2 * form + (s.stage == ROUGH)
    for k in np.unique(kind):
        own, (those,) = FORMS[k // 2], np.nonzero(kind == k)
        columns = [*(known[name][those] for name in own.terms), s.e[those] * s.v[those], np.ones(len(those))]
        columns = off_by_roundings(columns) if k % 2 else columns
        rows = followed(_runner(own), columns, s.tolerance[those])
        found = dict(zip(("time", "interval", *own.states), rows, strict=False))
        found = {"decay": columns[own.terms.index("drag")] * found["time"]} | found
        for name, column in zip(Swung._fields, swung, strict=True):
            column[those] = np.where(rows[-1] < FIRST_REFUSAL, found.get(name, _UNKNOWN.get(name, 0.0)), np.nan)
    return _found(*s[: len(Cell._fields)], s.v, *swung, s.rtol)


def _begins(cells, terms):
    """Not where steps are short for stability, nor where the drag is steep at rest; nor where a hairspring holds what
    creeps inwards, overdamped, before it comes to the switch."""
    creeps = (terms.kappa > terms.inwards) & (terms.drag * terms.drag >= 4.0 * terms.kappa) & (cells.e >= 0.0)
    smooth = (terms.degree >= _MILDEST) | ~(terms.gamma > 0.0)
    return np.where((terms.stiff < _STIFFEST) & smooth & ~creeps, Status.OK, Status.NO_METHOD)


BY_TAYLOR = Manner(
    "taylor", "Taylor series over half swings, each followed twice, and Newton on their map", follow, _begins,
    bare=True, steps=False, coarse=1e-4, orderly=np.inf, least=1e-17, rounding=2e-14,
    finer=FINER, shares=(0.1, 0.03, 0.001), told=(4.0, 4.0, 32.0), tighter=0.01,
)  # fmt: skip
"""Cores of abs(v)^n have a low order; of half swings of smooth ones the fine error is a fifteenth of the difference."""
