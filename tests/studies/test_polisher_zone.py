"""What the study of zones and of the tool's wear concludes is so."""

import numpy as np
import polisher_zone as study
import pytest
from scipy.integrate import quad

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="dozens of profiles; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("zone") / "polisher_zone.h5"
    sweep.run(sweep.study(study.__file__.replace(".py", ".toml")), path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return study.prepared(sweep.open_result(result).load())


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert study.main([str(result)]) == 0
    assert " NO" not in capsys.readouterr().out
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def alpha(t, e, b=0.6201, d=0.38, f=0.405):
    """Angle of the arm, type A: where the circles of arm and coupler meet."""
    pin = b * np.exp(-1j * np.radians(38.4)) + e * np.exp(1j * t)
    far = abs(pin)
    return np.angle(pin) + np.arccos((far**2 + d**2 - f**2) / (2 * d * far))


@pytest.mark.parametrize(("X", "Y", "beta"), [(0.04, 0.0, 0.0), (-0.04, 0.0, 0.1), (0.01, -0.03, -0.2)])
def test_a_point_of_the_tool_wears_by_its_mean_speed(ds, X, Y, beta):
    """By quadrature of the arm's angle from two circles, its rate by differences."""
    omega, Omega, L = 20 * np.pi / 30, 7.3 * np.pi / 30, 0.5

    def speed(t):
        rate = omega * (alpha(t + 1e-5, 0.1) - alpha(t - 1e-5, 0.1)) / 2e-5
        place = np.exp(1j * (alpha(t, 0.1) + beta)) * (L + X + 1j * Y)
        return abs(rate * place - Omega * (place - 0.5))

    true = 1e-13 * 7000 * quad(speed, 0, 2 * np.pi, limit=400, epsrel=1e-8)[0] / (2 * np.pi)
    here = study.tool_wear(ds, study.swings(ds), np.array(X), np.array(Y), beta)[1]
    # 720 crank angles of a speed that bends where the tool turns back: 1e-6
    assert float(here) == pytest.approx(true, rel=1e-5)


def failing(statements):
    return [s.what.strip() for s in statements if s.failed]


def test_false_wear_or_swings_are_seen(ds, monkeypatch):
    assert not failing(study.zones(ds)) + failing(study.tools(ds))
    assert failing(study.zones(ds.assign(low=ds.low + 0.1))) == ["the centre wears where (1) says"]
    assert failing(study.tools(ds.assign(tool=1.003 * ds.tool))) == ["(2) over all cells"]
    monkeypatch.setattr(study, "A0", {10.0: 38.404, 15.0: 36.1})
    assert len(failing(study.zones(ds))) == 2
