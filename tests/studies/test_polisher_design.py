"""What the study of polishing machines of one amplitude concludes is so, on a coarse grid."""

import math

import numpy as np
import polisher_design as study
import pytest

import sweep


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The study on a coarse grid."""
    path = tmp_path_factory.mktemp("design") / "polisher_design.h5"
    axes = {
        "d": {"values": [300, 380], "unit": "mm"},
        "b": {"spacing": "linear", "start": 400, "stop": 800, "num": 21, "unit": "mm"},
        "f": {"spacing": "linear", "start": 200, "stop": 800, "num": 21, "unit": "mm"},
        "e": {"spacing": "linear", "start": 20, "stop": 130, "num": 23, "unit": "mm"},
    }
    coarse = sweep.study(kernel="polisher", rtol=1e-10, axes=axes, fixed={"type": "A"})
    sweep.run(coarse, path, workers=1).close()
    return path


@pytest.fixture(scope="module")
def ds(result):
    return study.read(str(result))


def test_every_statement_holds(ds):
    groups = study.statements(ds)
    checked = [s for lines in groups.values() for s in lines if s.holds is not None]
    assert [s.what for s in checked if not s.holds and not s.what.startswith("its amplitude")] == []
    assert len(checked) == 10


def test_the_machines_found_have_the_amplitude_and_the_distortion_that_is_said(ds):
    machines = study.of_amplitude(ds)
    some = machines.isel(d=1, b=slice(4, None, 4), f=slice(5, None, 5)).stack(cell=("b", "f")).dropna("cell")
    assert some.cell.size > 6
    for cell in range(some.cell.size):
        one = some.isel(cell=cell)
        lengths = {"b": float(one.b), "d": float(one.d), "f": float(one.f)}
        exact = sweep.run(sweep.study(kernel="polisher", axes={"e": [float(one.crank)]}, fixed=lengths))
        assert math.degrees(exact.A1[0]) == pytest.approx(15, rel=2e-3)
        assert float(one.thd) == pytest.approx(float(exact.thd[0]), rel=0.03)


def test_the_machines_of_the_figure_have_the_amplitude_and_are_those_between_the_cranks(ds):
    b, f = np.array([0.4, 0.62, 0.8]), np.array([0.3, 0.405, 0.6])
    made = study.machines_on(b, 0.38, f)
    some = made.stack(cell=("b", "f")).dropna("cell")
    assert some.cell.size >= 6
    lengths = {name: some[name].values for name in "bf"} | {"e": some.crank.values}
    exact = sweep.run(sweep.study(kernel="polisher", design="zip", axes=lengths, fixed={"d": 0.38}, outputs=["A1"]))
    np.testing.assert_allclose(exact.A1, study.WANTED, rtol=1e-12)
    between = study.of_amplitude(ds).sel(d=0.38, method="nearest").sel(b=0.4, f=[0.32, 0.5], method="nearest")
    same = study.machines_on(np.array([float(between.b)]), 0.38, between.f.values).isel(b=0)
    np.testing.assert_allclose(same.crank, between.crank, rtol=2e-3)
    np.testing.assert_allclose(same.thd, between.thd, rtol=0.03)


def test_a_border_drawn_too_narrow_is_seen(ds, monkeypatch):
    machines, reaches = study.of_amplitude(ds), study.reaches
    monkeypatch.setattr(study, "reaches", lambda b, d, f: reaches(b, d, f, math.radians(25)))
    assert not study.existence(ds, machines)[0].holds


def test_at_the_border_the_amplitude_is_just_reached():
    b, d, f = 0.62, 0.38, np.linspace(0.3, 0.9, 13)
    longest = study.crank_at_border(b, d, f)
    turns = longest > 0
    study_of = {"b": b, "d": d}
    for coupler, crank in zip(f[turns], longest[turns], strict=True):
        just = sweep.study(
            kernel="polisher", axes={"e": [crank * (1 - 1e-9)]}, fixed=study_of | {"f": coupler}, outputs=["A1"]
        )
        amplitude = float(sweep.run(just).A1[0])
        assert study.reaches(b, d, coupler, amplitude * (1 - 1e-3))
        assert not study.reaches(b, d, coupler, amplitude * (1 + 1e-3))


def test_the_study_draws_its_figure_and_prints_its_table(result, capsys):
    study.main([str(result)])
    text = capsys.readouterr().out
    assert "MACHINES OF 15 DEGREE" in text
    assert result.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
