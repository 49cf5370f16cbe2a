"""What the study of a stiff lag concludes is so, on fewer cells; its closed form is the motion's."""

import mpmath
import pytest
import stiff_lag as study
from mpmath import mp, mpf

import sweep
from kernels.lanes.jit import COMPILED

many = pytest.mark.skipif(not COMPILED, reason="many steps")


def swept(path, toml, **axes):
    """Some cells of a study's grid."""
    whole = sweep.study(study.__file__.replace("stiff_lag.py", toml), allow_import=True)
    methods = {} if "e" in axes else {"method": ["taylor", "rodas5p"]}
    some = sweep.study(
        kernel=whole.kernel_name, rtol=whole.rtol, axes={**methods, **axes}, fixed=dict(whole.fixed), allow_import=True
    )
    sweep.run(some, path, workers=1, progress=False).close()
    return str(path)


@many
def test_the_study_draws_its_figure_and_every_statement_holds(tmp_path):
    lag = swept(tmp_path / "lag.h5", "stiff_lag.toml", mu=[0.1, 10.0], eps=[1e-9, 1e-5, 1e-1])
    bounce = swept(tmp_path / "bounce.h5", "stiff_lag_bounce.toml", d=[0.0, 0.3], flips=[20, 100, 3000], e=[0.1, 0.5])
    groups, notes, page = study.conclude(lag, bounce, tell=False)
    lines = [line for group in groups.values() for line in group]
    assert not [line.what for line in lines if line.failed]
    assert sum(line.holds is True for line in lines) == 4
    assert "unsolved 67%" in groups["Lag"][0].here  # taylor
    assert len(page.axes) == 7
    assert notes


@pytest.mark.parametrize(("mu", "eps"), [(2.0, 0.05), (0.3, 0.1), (20.0, 0.01)])
def test_the_closed_form_is_the_motions(mu, eps):
    a = mpf(study.FRICTION)
    with mp.workdps(25):
        motion = mpmath.odefun(
            lambda t, u: [u[1], u[2] - a * u[1], (mpf(mu) - a * u[1] - u[2]) / mpf(eps)], 0, [0, 0, 0]
        )
        guess = study.first_switch(mu, eps)
        true = mpmath.findroot(lambda t: motion(t)[0] - 1, guess)
        assert abs(mpf(float(guess)) / true - 1) < 1e-13
