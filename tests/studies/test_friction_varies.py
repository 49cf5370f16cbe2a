"""What the study of friction that varies concludes is so, with fewer seeds."""

import friction_varies as study
import mpmath as mp
import numpy as np
import pytest

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="millions of swings; the kernels' own tests run as plain Python")

FILES = ("friction_varies", "friction_varies_noise")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("friction")
    for name in FILES:
        path = study.__file__.replace("friction_varies.py", f"{name}.toml")
        sweep.run(sweep.study(path, allow_import=True), folder / f"{name}.h5", workers=1).close()
    return [str(folder / f"{name}.h5") for name in FILES]


@pytest.fixture(scope="module")
def parts(results):
    return [sweep.open_result(path).load() for path in results]


def test_the_study_draws_its_figure_and_every_statement_holds(results, capsys):
    assert study.main(results) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "no, known" in text


def test_oils_pass_through_their_points_and_differ_between():
    for temperature, viscosity in study.OIL:
        assert float(study.vogel(temperature)) == pytest.approx(viscosity, rel=1e-10)
    assert float(study.andrade(0.0)) == pytest.approx(3.0)
    assert float(study.andrade(20.0)) == pytest.approx(1.0)
    assert abs(float(study.andrade(40.0)) / 0.42 - 1) > 0.01


def test_a_half_period_under_friction_over_the_swing_is_that_of_a_series_of_30_digits(parts):
    """mpmath's Taylor integrator from the speed at the switch, which the scene gives, to the switch."""
    cell = parts[0].sel(mu=1.4629905875801047, harmonic=1).sel(depth=0.5, method="nearest")
    mu, d, v = float(cell.mu), mp.mpf("0.5"), abs(float(cell.speed))
    with mp.workdps(20):
        f = mp.odefun(lambda t, y: [y[1], mu - (1 + d * mp.cos(mp.pi * y[0])) * y[1]], 0, [-1, -v])
        t = mp.findroot(lambda t: f(t)[0] - 1, float(cell.interval))
        assert float(t) == pytest.approx(float(cell.interval), rel=1e-8)
        assert float(f(t)[1]) == pytest.approx(v, rel=1e-7)


def test_false_periods_and_scatters_make_statements_fail(parts):
    ds, noisy = parts
    assert not any(s.failed for s in study.over_the_swing(ds))
    slow = ds.assign(interval=ds.interval * (1 + 0.02 * ds.depth + 1e-3))
    assert [s.failed for s in study.over_the_swing(slow)][:3] == [True] * 3
    assert study.over_the_swing(slow)[-2].failed
    even = ds.assign(interval=ds.interval.sel(depth=0, method="nearest").broadcast_like(ds.interval))
    assert study.over_the_swing(even)[-1].failed  # the paper would be right
    loud = noisy.assign(rate_scatter_s_per_day=1.4 * noisy.rate_scatter_s_per_day)
    assert sum(s.failed for s in study.by_noise(loud)) == 8


def test_the_year_of_a_clock_at_one_half_is_quieter():
    weak, half = (np.ptp(study.seasons(mu, study.vogel)[1]) for mu in (0.1, 1.4629905875801047))
    assert half < weak / 10
