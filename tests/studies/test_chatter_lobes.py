"""What the study of stability lobes concludes is so: by 50 digits, and by integration of the cut itself."""

import chatter_lobes as study
import mpmath
import numpy as np
import pytest
from chain_oracles import receptance
from scipy.linalg import expm

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="90 000 receptances; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("lobes") / "chatter_lobes.h5"
    sweep.run(sweep.study(study.__file__.replace(".py", ".toml")), path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return study.read(str(result))


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert study.main([str(result)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "least K at 535.0 N m/rad instead of 536.4" in text
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("n", [8, 5])
@pytest.mark.parametrize("i", [1200, 4000, 9000, 13000])
def test_the_lobes_fulfil_the_equation_of_the_delay_in_50_digits(ds, n, i):
    chain, f = study.chains(ds)[n], study.FREQUENCIES[i]
    with mpmath.workdps(50):
        H = receptance(chain["J"], chain["k"], chain["h"], f, 1, 1)
        for k in (0, 3):
            tooth, K = (float(v[i]) for v in study.lobe(ds.H.sel(n_keep=n).values, k))
            turn = mpmath.exp(mpmath.mpc(0, -2) * mpmath.pi * f / tooth)
            # K is right to the receptance's 1e-12, (1) to that and to the rounding of k + 1/2 turns
            assert abs(1 + K * (1 - turn) * H) < 1e-10


def growth(chain, tooth, K):
    """How much the spindle's angle grows from one quarter of 400 teeth to the last, the cut integrated step by step.

    Exact for a delayed torque that is linear within a step, of which a tooth takes 120: off by 1e-3 of K.
    """
    n, steps = len(chain["J"]), 120
    grid = [
        np.diag(c + np.r_[0.0, c[:-1]]) - np.diag(c[:-1], 1) - np.diag(c[:-1], -1) for c in (chain["k"], chain["h"])
    ]
    first = np.zeros((n, n))
    first[0, 0] = K
    J = chain["J"][:, None]
    flow = np.block([[np.zeros((n, n)), np.eye(n)], [-(grid[0] + first) / J, -grid[1] / J]])
    push = np.zeros(2 * n)
    push[n] = K / chain["J"][0]
    h = 1 / (tooth * steps)
    whole = np.zeros((2 * n + 2, 2 * n + 2))
    whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n], whole[2 * n, 2 * n + 1] = flow * h, push * h, 1.0
    step = expm(whole)[: 2 * n]
    angles = np.zeros(400 * steps + 1)
    state = np.zeros(2 * n)
    state[n] = 1.0
    for i in range(1, angles.size):
        old = angles[max(i - 1 - steps, 0)]
        state = step @ np.r_[state, old, angles[max(i - steps, 0)] - old]
        angles[i] = state[0]
    quarters = np.abs(angles[1:]).reshape(4, -1).max(axis=1)
    return quarters[3] / quarters[1]


@pytest.mark.parametrize("n", [8, 5])
@pytest.mark.parametrize("tooth", [13.0, 24.0])
def test_a_cut_below_the_border_dies_out_and_one_above_it_grows(ds, n, tooth):
    K = float(np.interp(tooth, study.TEETH, ds.border.sel(n_keep=n)))
    chain = study.chains(ds)[n]
    assert growth(chain, tooth, 0.98 * K) < 0.5
    assert growth(chain, tooth, 1.02 * K) > 2.0


def failing(statements):
    return [s.what.strip() for s in statements if s.failed]


def test_a_false_receptance_or_border_is_seen(ds):
    assert not failing(study.whole_chain(ds)) + failing(study.moved(ds))
    assert "(1) on the lobes, H by the script" in failing(study.whole_chain(ds.assign(H=1.0001 * ds.H)))
    higher, lower = (failing(study.whole_chain(ds.assign(border=x * ds.border))) for x in (1.03, 0.97))
    assert (higher, lower) == (["roots to the right, 1 % below the border"], ["1 % above it"])
    assert len(failing(study.whole_chain(ds.assign(K=1.001 * ds.K)))) == 4
    worse = ds.assign(border=ds.border.where(ds.n_keep != 5, 1.1 * ds.border))
    assert len(failing(study.moved(worse))) == 3
