"""What the study of polishing sequences concludes is so, on a coarse grid."""

import numpy as np
import polisher_sequence as study
import pytest
from scipy.optimize import minimize

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="dozens of profiles; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("sequence") / "polisher_sequence.h5"
    sweep.run(sweep.study(study.__file__.replace(".py", ".toml")), path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return sweep.open_result(result).load()


def test_the_study_draws_its_figure_and_every_statement_holds(result, capsys):
    assert study.main([str(result)]) == 0
    assert " NO" not in capsys.readouterr().out
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_no_other_minimiser_finds_a_more_even_mixture(ds):
    weight = study.weights(ds)
    rows, shares, mixed = study.mixture(ds)
    assert (shares >= 0).all()
    few = rows[shares > 0.005]

    def uneven(x):
        x = x**2
        return study.unevenness(x @ few / x.sum(), weight)

    other = minimize(uneven, np.ones(len(few)), method="Powell", options={"xtol": 1e-6, "maxiter": 50}).fun
    assert study.unevenness(mixed, weight) < other * 1.0001


def test_false_wear_or_a_false_mixture_is_seen(ds, monkeypatch):
    assert not any(s.failed for s in study.optimum(ds))
    rows, shares, _ = study.mixture(ds)
    shares = shares[::-1].copy()
    monkeypatch.setattr(study, "mixture", lambda _: (rows, shares, shares @ rows))
    assert any(s.failed for s in study.optimum(ds))


def test_a_false_middle_is_seen(ds, monkeypatch):
    assert not any(s.failed for s in study.correction(ds))
    monkeypatch.setattr(study, "middle", lambda d, e, b, f: 1.2 - d + 0.5 * e)
    assert sum(s.failed for s in study.correction(ds)) == 2
