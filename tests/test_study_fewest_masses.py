"""What the study of the fewest masses concludes is so, on few drivetrains."""

import fewest_masses as study
import numpy as np
import pytest

import sweep
from kernels._jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="hundreds of cells; the kernel's own tests run as plain Python")


@pytest.fixture(scope="module")
def ds():
    return study.needed(study.drivetrains(12))


def test_every_statement_holds(ds):
    lines = [s for group in study.statements(ds).values() for s in group]
    assert len(lines) == 3
    assert all(s.holds for s in lines)


def test_the_script_draws_its_figure(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert study.main(["6"]) == 0
    assert "MASSES KEPT" in capsys.readouterr().out
    assert (tmp_path / "fewest_masses.png").read_bytes().startswith(b"\x89PNG")
    assert study.main(["many"]) == 2


def test_a_band_holds_just_its_frequencies():
    chains = study.drivetrains(3)
    f = study.swept(chains, ["frequency"]).frequency.values
    assert ((f[:, None, :] <= study.bands(chains)[:, :, None]).sum(axis=2) == study.INSIDE).all()


def test_more_masses_for_modal_reduction_make_a_statement_fail(ds):
    lines = next(iter(study.statements(ds.assign(kept=ds.kept + 1)).values()))
    assert not lines[0].holds
    assert not next(iter(study.statements(ds.assign(kept=ds.kept - 1)).values()))[1].holds


def test_the_file_to_begin_with_is_sound():
    first = sweep.read_study(study.__file__.replace(".py", ".toml"))
    assert len(first.fixed["J"]) == 10
    assert np.isclose(first.fixed["tol"], study.TOLERANCE)
