"""What the study of the driven balance's isochronism concludes is so, on coarse grids."""

import balance_isochronism as study
import mpmath as mp
import numpy as np
import pytest

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="hundreds of swings; the integrator's tests run as plain Python")

FILES = ("balance_isochronism", "balance_isochronism_lift", "balance_isochronism_positions")


def thinned(name):
    """A study with every second value of the long axes, and every fourth angle of the impulse."""
    read = sweep.study(study.__file__.replace("balance_isochronism.py", f"{name}.toml"), allow_import=True)
    steps = {"w": 2, "m": 2, "at": 4}
    axes = {axis: x.values[:: steps.get(axis, 1)] for axis, x in read.axes.items()}
    keys = {"kernel": read.kernel_name, "rtol": 1e-11, "axes": axes, "fixed": dict(read.fixed)}
    return sweep.study(**keys, allow_import=True)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("isochronism")
    for name in FILES:
        sweep.run(thinned(name), folder / f"{name}.h5", workers=1).close()
    return [str(folder / f"{name}.h5") for name in FILES]


@pytest.fixture(scope="module")
def parts(results):
    return study.read(*results)


def test_the_study_draws_its_figure_and_every_statement_holds(results, capsys):
    assert study.main(results) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "figure: " in text


def swing(at, r, zeta, w):
    """Amplitude and half period at 50 digits: from an impulse to the peak and on to the next, closed by a root."""
    with mp.workdps(50):
        at, r, zeta, w = (mp.mpf(x) for x in (at, r, zeta, w))
        root = mp.sqrt(1 - zeta**2)

        def leg(u, v, t):
            by = (v + zeta * u) / root
            x = mp.exp(-zeta * t) * (u * mp.cos(root * t) + by * mp.sin(root * t))
            y = mp.exp(-zeta * t) * (v * mp.cos(root * t) - (u + zeta * v) / root * mp.sin(root * t))
            return x, y

        def half(v):
            up = mp.findroot(lambda t: leg(at + r, v, t)[1], mp.pi / 2)
            a = leg(at + r, v, up)[0] - r
            back = mp.findroot(lambda t: leg(-(a - r), mp.mpf(0), t)[0] - (at + r), mp.pi / 2)
            met = leg(-(a - r), mp.mpf(0), back)[1]
            return up + back, mp.sqrt(met**2 + 2 * w), a

        first = (mp.sqrt(r**2 + mp.pi * zeta * w) - r) / (mp.pi * zeta)
        v = mp.findroot(lambda v: half(v)[1] - v, (first, first * mp.mpf("1.01")), solver="secant")
        time, _, a = half(v)
        return a, time


@pytest.mark.parametrize("at", [-0.1, -0.025, 0.0, 0.05])
def test_amplitude_and_period_are_those_of_50_digits(at):
    zeta, r, w = 1 / 600, 0.025, 0.05
    fixed = {"zeta": zeta, "omega_n": 1.0, "r": r, "w": w, "flips": 2001}
    made = sweep.study(kernel="balance_scene:KERNEL", axes={"at": [at]}, fixed=fixed, rtol=1e-12, allow_import=True)
    ds = sweep.run(made)
    a, half = swing(at, r, zeta, w)
    assert float(ds.clock[0]) == pytest.approx(float(2 * half), rel=1e-11)
    assert float(study.reach(ds)[0]) == pytest.approx(float(a), rel=1e-8)
    if at == -r:
        assert float(2 * half) == pytest.approx(2 * np.pi / np.sqrt(1 - zeta**2), rel=1e-14)


def test_a_loss_at_the_shifted_centre_or_a_turn_elsewhere_is_seen(parts):
    ds = parts[0]
    assert not any(s.failed for s in study.impulses(ds))
    assert study.impulses(ds.assign(loss=ds.loss + 0.01))[0].failed
    assert study.impulses(ds.assign(loss=1.05 * ds.loss))[1].failed
    bent = ds.assign(loss=ds.loss.where(ds.w < 0.1, ds.loss + 5e3 * (ds.w - 0.1)))
    assert study.impulses(bent)[2].failed
    assert study.impulses(ds.assign(clock=ds.clock * (1 + 1e-5)))[4].failed


def test_lifts_and_positions_that_behave_otherwise_are_seen(parts):
    _, lift, hung = parts
    rising = lift.assign(loss=lift.amplitude)
    assert all(s.failed for s in study.lifts(rising))
    assert all(s.failed for s in study.positions(hung.assign(loss=1.1 * hung.loss + (hung.hang < 2) * 0.2)))


def test_friction_of_a_pivot_is_that_of_the_friction_circle():
    assert study.pivot_friction(0.15, 1e-4, 9.81, 5e-5) == pytest.approx(9.81e-4 * 5e-5 * np.sin(np.arctan(0.15)))
    assert study.end_friction(0.15, 1e-4, 9.81, 3e-5) == pytest.approx(0.15 * 9.81e-4 * 2e-5)
