"""What the study of impacts and friction in a verge concludes is so, on a coarse grid."""

import numpy as np
import pytest
import verge_losses as study
from scipy.integrate import solve_ivp

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="millions of swings; the integrator's tests run as plain Python")

FILES = ("verge_losses", "verge_losses_wheel")


def thinned(name):
    """A study with half of its wheels and torques, except those that the conclusions name."""
    read = sweep.study(study.__file__.replace("verge_losses.py", f"{name}.toml"), allow_import=True)
    axes = {axis: x.values for axis, x in read.axes.items()}
    if axes["I_c"].size > 3:
        axes["I_c"] = axes["I_c"][[0, 4, 5, 6, 8, 12, 16]]
    fixed = dict(read.fixed) | {"flips": 3000}
    return sweep.study(kernel=read.kernel_name, rtol=1e-9, axes=axes, fixed=fixed, allow_import=True)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("verge")
    for name in FILES:
        sweep.run(thinned(name), folder / f"{name}.h5", workers=2).close()
    return [str(folder / f"{name}.h5") for name in FILES]


@pytest.fixture(scope="module")
def ds(results):
    return study.prepared(sweep.open_result(results[0]).load())


@pytest.fixture(scope="module")
def wheel(results):
    return study.prepared(sweep.open_result(results[1]).load())


def test_the_study_draws_its_figure_and_every_statement_holds(results, capsys):
    assert study.main(results) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "figure: " in text


def half_periods(p, count):
    """Half periods and viscous losses by solve_ivp, contact and flight as two equations of motion."""
    Iv, J, n, tau = p["I_v"], p["I_c"], p["n"], p["tau"]
    c, R, phi0, drop = p["c_v"], p["R_v"], p["phi0"], p["drop"]
    angle, speed, found = -phi0, 0.0, []
    how = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}

    def until(event, rates, y, direction=1):
        event.terminal, event.direction = True, direction
        leg = solve_ivp(rates, (0, 1e4), y, events=event, **how)
        return leg.t[-1], leg.y[:, -1]

    for _ in range(count):
        time, y = 0.0, np.array([angle, speed, 0.0])
        if speed < 0:

            def back(t, y):
                return y[1], (n * tau - c * y[1] + R) / (Iv + n * n * J), c * y[1] ** 2

            spent, y = until(lambda t, y: y[1], back, y)
            time += spent

        def push(t, y):
            return y[1], (n * tau - c * y[1] - R) / (Iv + n * n * J), c * y[1] ** 2

        spent, y = until(lambda t, y: y[0] - phi0, push, y)
        time += spent
        gap, wheel, foliot, drag = drop, n * y[1], y[1], y[2]

        def fly(t, y):
            return y[1], (-c * y[1] - R) / Iv, tau / J, -(y[2] + n * y[1]), c * y[1] ** 2

        spent, z = until(lambda t, y: y[3], fly, [phi0, foliot, wheel, gap, drag], -1)
        time += spent
        angle, speed = -z[0], (n * J * z[2] - Iv * z[1]) / (Iv + n * n * J)
        found.append((time, z[4]))
    return found


def test_the_cycle_is_that_of_an_own_integration():
    p = {"tau": 0.02, "I_v": 1e-4, "I_c": 2.5e-4, "n": 0.2, "phi0": 0.35, "drop": 0.01, "c_v": 1e-4, "R_v": 3.5e-4}
    made = sweep.study(
        kernel="verge_scene:KERNEL", axes={"tau": [p["tau"]]}, fixed={k: v for k, v in p.items() if k != "tau"}
        | {"flips": 120}, rtol=1e-11, allow_import=True,
    )  # fmt: skip
    cell = sweep.run(made).isel(tau=0)
    time, drag = half_periods(p, 60)[-1]
    assert float(cell.clock) == pytest.approx(time, rel=1e-8)
    assert float(cell["drag"]) == pytest.approx(drag, rel=1e-8)


def test_the_law_by_the_shares_has_the_pure_exponents():
    one = {"viscous": 1.0, "impact": 0.0}
    import xarray as xr

    assert float(study.law(xr.Dataset(one))) == pytest.approx(1 / 3)
    assert float(study.law(xr.Dataset({"viscous": 0.0, "impact": 1.0}))) == pytest.approx(1 / 2)
    assert float(study.law(xr.Dataset({"viscous": 0.0, "impact": 0.0}))) == 0


def failing(statements):
    return [s.what for s in statements if s.failed]


def test_false_periods_or_losses_make_the_statements_fail(ds, wheel):
    assert failing(study.balance(ds.assign(dry=ds.dry + 1e-7)))
    steep = ds.assign(s=ds.s + 0.02)
    assert len(failing(study.ends(steep))) == 3
    assert len(failing(study.by_shares(ds.assign(viscous=0.9 * ds.viscous)))) >= 1
    assert failing(study.ends(ds.assign(period=1.04 * ds.period))) == [study.one_body(ds.isel(R_v=0))[0].what]
    assert len(failing(study.on_the_wheel(steep.assign(s=ds.s + 0.03), wheel))) == 2
    assert failing(study.turns(ds.assign(s=ds.s + 0.03)))
