"""What the study of the fewest masses concludes is so, on few drivetrains."""

from pathlib import Path

import fewest_masses as study
import numpy as np
import pytest

import sweep
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="hundreds of cells; the kernel's own tests run as plain Python")
POINTS = Path(study.__file__).with_suffix(".csv")


@pytest.fixture(scope="module")
def ds():
    return study.needed(study.drivetrains(12))


def test_every_statement_holds(ds):
    lines = [s for group in study.statements(ds).values() for s in group]
    assert len(lines) == 4
    assert all(s.holds for s in lines)


def test_the_script_prints_the_cost_of_every_method_and_draws_its_figure(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(study, "TIMES", 1)
    assert study.main(["6"]) == 0
    printed = capsys.readouterr().out
    assert "MASSES KEPT, mean of 6 drivetrains" in printed
    costs = printed[printed.index("ERRORS LEFT") :].splitlines()[2:7]
    for name, line in zip(study.METHODS, costs, strict=True):
        assert line.startswith(name)
        assert all(float(x) > 0 for x in line.split()[-2:])
    assert (tmp_path / "fewest_masses.png").read_bytes().startswith(b"\x89PNG")
    assert study.main(["many"]) == 2


def test_a_band_holds_just_its_frequencies():
    chains = study.drivetrains(3)
    f = study.swept(chains, ["frequency"]).frequency.values
    assert ((f[:, None, :] <= study.bands(chains)[:, :, None]).sum(axis=2) == study.INSIDE).all()


def test_what_is_kept_holds_the_frequencies_to_one_percent(ds):
    assert float(ds.error.max()) <= study.TOLERANCE
    assert float(ds.error.sel(reduction="rivin").max()) > 0.5 * study.TOLERANCE
    assert float(ds.error.sel(reduction="modal").max()) < 1e-13


def test_more_masses_for_modal_reduction_make_a_statement_fail(ds):
    lines = next(iter(study.statements(ds.assign(kept=ds.kept + 1)).values()))
    assert not lines[0].holds
    assert not next(iter(study.statements(ds.assign(kept=ds.kept - 1)).values()))[1].holds
    assert not next(iter(study.statements(ds.assign(error=5 * ds.error)).values()))[3].holds


def test_the_file_holds_the_drivetrains_and_bands_of_the_script(tmp_path):
    study.write_points(tmp_path / "points.csv")
    assert (tmp_path / "points.csv").read_text() == POINTS.read_text()
    first = sweep.study(POINTS.with_suffix(".toml"))
    chains = study.drivetrains(study.DRIVETRAINS)
    assert first.axes["J"].values.shape == (study.DRIVETRAINS, study.MASSES)
    assert (first.axes["J"].values == chains["J"]).all()
    assert (first.axes["k"].values == chains["k"]).all()
    assert first.fixed["tol"] == study.TOLERANCE
    assert np.unique(first.fixed["h"]) == study.DAMPER


def test_the_file_can_be_run_on_its_first_drivetrains():
    whole = sweep.study(POINTS.with_suffix(".toml"))
    some = {name: whole.axes[name].values[:16].tolist() for name in ("J", "k", "f_max")}
    fixed = {"h": study.DAMPER, "tol": study.TOLERANCE, "reduction": "rivin"}
    ds = sweep.run(sweep.study(kernel="drivetrain", design="zip", axes=some, fixed=fixed), progress=False)
    inside = np.arange(16) % len(study.INSIDE) + 1
    assert (ds.n_kept.values >= inside).all()
    assert ((ds.frequency.values <= ds.f_max.values[:, None]).sum(axis=1) == inside).all()
