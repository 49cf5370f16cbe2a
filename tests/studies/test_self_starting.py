"""What the study of foliots that start themselves concludes is so."""

import numpy as np
import pytest
import self_starting as study
from scipy.integrate import solve_ivp

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="thousands of cells; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("start") / "self_starting.h5"
    sweep.run(sweep.study(study.__file__.replace(".py", ".toml")), path, workers=1).close()
    return path


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert study.main([str(result)]) == 0
    assert " NO" not in capsys.readouterr().out
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("a", "mu", "start"), [(0.0, 1.2, -0.5), (1.0, 1.2, -0.5), (0.0, 0.5, -0.5), (1.0, 1.7, 0.0)])
def test_a_release_ends_as_its_integration(a, mu, start):
    """k = 1.5, R = 0.2: up to the switch or to the first rest, by DOP853."""
    k, R = 1.5, 0.2

    def stop(t, y):
        return y[1]

    def switch(t, y):
        return y[0] - 1

    stop.terminal, stop.direction = True, -1
    switch.terminal = True
    push = mu - k * start - R
    run = solve_ivp(
        lambda t, y: (y[1], mu - k * y[0] - R - a * y[1]), (0, 1e3), (start + push * 5e-9, push * 1e-4),
        events=(stop, switch), method="DOP853", rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    made = sweep.study(
        kernel="foliot_start", axes={"mu": [mu]}, along={"flip": [1]}, rtol=1e-9,
        fixed={"phi0": 1, "k": k, "R": R, "a": a, "phi_start": start},
    )  # fmt: skip
    time = float(sweep.run(made).flip_time.isel(flip=0, mu=0))
    assert bool(len(run.t_events[1])) == np.isfinite(time)
    if np.isfinite(time):
        assert time == pytest.approx(run.t[-1] + 1e-4, abs=3e-4)


def test_other_borders_make_the_statements_fail(result):
    with sweep.open_result(result) as opened:
        ds = opened.load()
    assert not any(s.failed for lines in study.statements(ds).values() for s in lines)
    moved = ds.assign_coords(R=ds.R + 0.05)
    assert study.statements(moved)["Coulomb friction, stiction and hairspring"][0].failed
    easy = ds.assign(flip_time=ds.flip_time.where(ds.mu < 0.5, 1.0))
    assert sum(s.failed for s in study.statements(easy)["Coulomb friction, stiction and hairspring"]) >= 2
