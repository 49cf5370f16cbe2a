"""What the study of the polisher's extremes concludes is so, on a coarse grid."""

import numpy as np
import polisher_extrema as study
import pytest

import sweep
from kernels.interface import Status


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The study with a handful of eccentricities, the border among them."""
    path = tmp_path_factory.mktemp("extrema") / "polisher_extrema.h5"
    e = {"values": [0, 1, 2, 5, 8, 10, 12, 14, 15, 16, 16.48, 16.49, 16.5, 17, 18], "unit": "cm"}
    fixed = {"b": 0.6201, "d": 0.38, "f": 0.405, "type": "A"}
    coarse = sweep.study(kernel="polisher", rtol=1e-12, axes={"e": e}, fixed=fixed)
    sweep.run(coarse, path, workers=1).close()
    return path


def test_every_statement_holds(result):
    groups = study.statements(study.read(str(result)))
    checked = [s for lines in groups.values() for s in lines if s.holds is not None]
    assert [s.what for s in checked if s.failed] == []
    assert len(checked) == 17


def test_an_amplitude_without_its_half_is_seen(result):
    ds = study.read(str(result))
    doubled = study.size(ds.assign(A1=2 * ds.A1, A1_e=2 * ds.A1_e))
    assert sum(s.failed for s in doubled) >= 3


def test_a_border_at_the_wrong_place_is_seen(result):
    ds = study.read(str(result))
    moved = ds.assign(status=ds.status.where(ds.e != 0.165, Status.OK))
    assert any(s.failed for s in study.border(moved))


def test_the_motion_drawn_has_the_extremes_of_the_sweep(result):
    ds = study.read(str(result))
    alpha = study.motions(ds).alpha - study.B_ANGLE
    shown = ds.sel(e=list(study.SHOWN), method="nearest")
    np.testing.assert_allclose(alpha.max("crank_angle"), shown.eta_plus, atol=1e-4)
    np.testing.assert_allclose(alpha.min("crank_angle"), shown.eta_minus, atol=1e-4)
    assert float(alpha.max()) + study.B_ANGLE == pytest.approx(0.423, abs=1e-3)
    assert float(alpha.min()) + study.B_ANGLE == pytest.approx(-0.482, abs=1e-3)


def test_the_study_draws_its_figure_and_prints_its_table(result, capsys):
    assert study.main([str(result)]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "21.2 degree" in text
    assert "no, known" in text
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
