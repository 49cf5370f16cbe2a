"""Indices of a foliot's parameters are what the exponents of its closed form say."""

import mpmath
import numpy as np
import pytest
import rate_parameters as study

import sweep

pytest.importorskip("SALib")


def quarter(k):
    """Root of q - tanh q = k."""
    return mpmath.findroot(lambda q: q - mpmath.tanh(q) - k, k + 1)


def exponent(alpha):
    """-d ln P/d ln mu of the viscous foliot, by 30-digit differences of the root of q - tanh q = 1/alpha."""
    with mpmath.workdps(30):
        low, high = mpmath.mpf("0.999"), mpmath.mpf("1.001")
        slower, faster = (quarter(1 / (alpha * factor)) for factor in (low, high))
        return float(-mpmath.log(faster / slower) / mpmath.log(high / low))


@pytest.mark.parametrize("drive", [0.05, 1.46299, 30.0])
def test_shares_are_squares_of_exponents(drive):
    torque = {**study.RANGES["mu"], "start": 0.9048 * drive, "stop": 1.1052 * drive}
    axes = {**study.RANGES, "mu": torque}
    ds = sweep.run(kernel="foliot", outputs=["period"], design={"kind": "saltelli", "n": 256, "seed": 2}, axes=axes)
    found = sweep.sensitivity(ds, np.log(ds.period)).total.to_series()
    s = exponent(drive)
    squares = np.array([s**2, (2 * s - 1) ** 2, s**2])
    assert found[["mu", "a", "phi0"]].values == pytest.approx(squares / squares.sum(), abs=0.02)


def test_the_study_comes_to_its_conclusions(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study, "DRIVES", np.array([0.1, 1.46, 10.0]))
    path = tmp_path / "rate_parameters.h5"
    sweep.run("studies/rate_parameters.toml", path).close()
    assert study.main([str(path)]) == 0
    assert path.with_suffix(".png").exists()
    said = capsys.readouterr().out
    assert "NO" not in said.split("Friction decides")[0]


def test_another_design_is_refused(tmp_path, capsys):
    path = tmp_path / "other.h5"
    sweep.run(path=path, kernel="foliot", axes={"mu": [1.0, 2.0]}, fixed={"a": 1.0, "phi0": 1.0}).close()
    assert study.main([str(path)]) == 2
