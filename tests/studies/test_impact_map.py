"""What the study of colliding crown wheel and foliot concludes is so, on a coarse grid."""

import dataclasses

import impact_map
import numpy as np
import pytest

import sweep
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="hundreds of cells; the kernel's own tests run as plain Python")


def thinned(name, **steps):
    """A study with every n-th value of some axes."""
    study = sweep.study(impact_map.__file__.replace("impact_map.py", f"{name}.toml"))
    axes = dict(study.axes)
    for axis, step in steps.items():
        axes[axis] = dataclasses.replace(axes[axis], values=axes[axis].values[::step], words=None)
    return dataclasses.replace(study, axes=axes)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("impact")
    paths = [folder / "impact_map.h5", folder / "impact_map_lever.h5"]
    for path, steps in zip(paths, ({"I_c": 16, "e": 24}, {"I_c": 16, "nu": 16}), strict=True):
        sweep.run(thinned(path.stem, **steps), path, workers=1).close()
    return paths


@pytest.fixture(scope="module")
def closed_and_motion(results):
    ds = impact_map.prepared(sweep.open_result(results[0]).load())
    return [ds.sel({"method": name}) for name in ("closed", "events")]


@pytest.fixture(scope="module")
def bent(results):
    return impact_map.prepared(sweep.open_result(results[1]).load())


def failing(statements):
    return [s.what for s in statements if s.holds is False]


def test_the_study_draws_its_figure_and_every_statement_holds(results, capsys):
    assert impact_map.main([str(path) for path in results]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert "A CURVED LEVER" in text
    assert results[0].with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_the_motion_is_of_every_kind_the_map_names(closed_and_motion):
    kind = impact_map.kinds(closed_and_motion[1]).values
    assert set(range(6)) <= set(kind.ravel().tolist())


def test_a_light_foliot_with_little_restitution_beats_with_one_impact(closed_and_motion):
    kind = impact_map.kinds(closed_and_motion[1])
    assert (kind.where((kind.kappa > 3) & (kind.e > 0.15) & (kind.e < 0.4), 0) == 0).all()


def test_the_conclusion_in_words_has_the_numbers_of_the_grid(closed_and_motion):
    closed = closed_and_motion[0]
    kappa, e, swing = (closed[name].broadcast_like(closed.Y).values for name in ("kappa", "e", "Y"))
    steady = (closed.status.values == Status.OK) & (e > 0)
    ends = [e[steady & (kappa == kappa[steady].max())].min(), e[steady & (kappa == kappa[steady].max())].max()]
    text = " ".join(impact_map.words(closed).split())
    assert f"from {ends[0]:.2f} to {ends[1]:.2f} at {kappa[steady].max():.3g}." in text
    assert f"swing is {swing[steady].min():.2f} to {swing[steady].max():.2f} of" in text


def test_heavy_foliots_have_no_stable_cycle_of_one_impact(closed_and_motion):
    closed = closed_and_motion[0]
    heavy = closed.where((closed.kappa < 0.99) & (closed.e > 0), drop=True)
    assert not (heavy.status == Status.OK).any()
    assert (heavy.status == Status.UNSTABLE).any()


@pytest.mark.parametrize(
    ("name", "factor", "statement"),
    [
        ("multiplier", 1.5, "stable for kappa > 1 and no other"),
        ("recoil", -1.0, "recoil for kappa < 2e/(1 - e)"),
    ],
)
def test_a_false_result_makes_its_statement_fail(closed_and_motion, name, factor, statement):
    closed = closed_and_motion[0]
    wrong = impact_map.prepared(closed.assign({name: closed[name] * factor}))
    assert statement in failing(impact_map.cycle(wrong))
    assert not failing(impact_map.cycle(closed))


def test_a_false_period_by_events_makes_the_statement_fail(closed_and_motion):
    closed, motion = closed_and_motion
    assert not failing(impact_map.motions(closed, motion))
    assert failing(impact_map.motions(closed, motion.assign(period=motion.period * 1.001))) == ["period by events = 2T"]
    wrong = impact_map.prepared(motion.assign(swing=motion.swing * 0.999))
    assert failing(impact_map.motions(closed, wrong)) == ["swing by events = Y, whatever the torque"]


def test_a_false_plastic_cycle_makes_its_statement_fail(closed_and_motion):
    closed = closed_and_motion[0]
    assert not failing(impact_map.plastic(closed))
    assert len(failing(impact_map.plastic(closed.assign(period=closed.period * 1.001)))) == 1


def test_the_levers_borders_are_where_the_multiplier_passes_one(bent):
    low, high = impact_map.lever_borders(0.5, 0.6)
    assert (low, high) == pytest.approx((-24.0, -4 * 2.56 / (0.16 * 0.5 + 2 * 1.36)))
    moved = bent.assign_coords(nu=bent.nu + 1.0)
    assert failing(impact_map.lever(moved))
    assert not failing(impact_map.lever(bent))
    assert np.isfinite(bent.multiplier).any()
