"""What the study of stick and slip concludes is so, on fewer cells; its closed form is the motion's."""

import mpmath
import numpy as np
import pytest
import stick_slip as study
from mpmath import mp, mpf

import sweep
from kernels.lanes.jit import COMPILED

many = pytest.mark.skipif(not COMPILED, reason="many steps")


def swept(path, **axes):
    """Some cells of the study's grid."""
    whole = sweep.study(study.__file__.replace(".py", ".toml"), allow_import=True)
    some = sweep.study(kernel=whole.kernel_name, rtol=whole.rtol, axes=axes, fixed=dict(whole.fixed), allow_import=True)
    sweep.run(some, path, workers=1, progress=False).close()
    return str(path)


@many
def test_the_study_draws_its_figure_and_every_statement_holds(tmp_path):
    path = swept(tmp_path / "stick_slip.h5", method=["taylor", "dop853"], belt=[0.02, 0.3], fall=[0.02, 0.3])
    groups, notes, page = study.conclude(path, tell=False)
    lines = [line for group in groups.values() for line in group]
    assert not [line.what for line in lines if line.failed]
    assert sum(line.holds is True for line in lines) == 3
    assert "-" not in groups["Cost of two cycles"][0].here.split(", ")
    assert len(page.axes) == 7
    assert all(abs(np.diff(drawn.get_ydata())).max() < 0.05 for drawn in page.axes[0].lines)  # a smooth curve
    assert notes


@pytest.mark.parametrize(("mu", "belt", "fall"), [(1.0, 0.3, 0.4), (2.0, 0.01, 0.02)])
def test_the_closed_form_is_the_motions(mu, belt, fall):
    with mp.workdps(25):
        slips = mpmath.odefun(lambda t, u: [u[1], fall * u[1] - u[0] + mu], 0, [mu + mpf(fall) * belt, mpf(belt)])
        caught = mpmath.findroot(lambda t: slips(t)[1] - belt, (4.0, 6.5), solver="anderson")
        cycle = caught + (mu + mpf(fall) * belt - slips(caught)[0]) / belt
        true = mpf(mu) / belt + 20 * cycle
        assert abs(mpf(float(study.last_count(41.0, mu, belt, fall))) / true - 1) < 1e-14
