"""Refined sweeps: interpolation to the accuracy asked for, borders followed, fewer cells than an even grid."""

import dataclasses
import signal

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import LinearNDInterpolator
from toy import KERNEL as TOY
from toy import exact
from toy_studies import build

import sweep
from kernels.interface import Status
from sweep.cli import main

FIXED = {"phi0": 1.0, "a": 1.0}


def foliot(fixed=FIXED, **axes):
    """The period of a foliot over logarithmic axes of (start, stop, num)."""
    keys = {name: {"spacing": "log", "start": a, "stop": b, "num": n} for name, (a, b, n) in axes.items()}
    fixed = {name: value for name, value in fixed.items() if name not in axes}
    return sweep.run(kernel="foliot", axes=keys, fixed=fixed, outputs=["period", "multiplier"])


def error_between(dataset, **fixed):
    """The largest relative error of straight lines between the cells with a value, along a logarithmic mu."""
    ds = dataset.isel(mu=np.flatnonzero(dataset.status == 0))
    mu = np.exp(np.random.default_rng(1).uniform(*np.log(ds.mu.values[[0, -1]]), 500))
    truth = sweep.run(kernel="foliot", axes={"mu": mu}, fixed=FIXED | fixed, outputs=["period"]).period
    guess = np.exp(np.interp(np.log(mu), np.log(ds.mu.values), np.log(ds.period.values)))
    return float(abs(guess / truth - 1).max())


def own(solve, heights, **axes):
    """A study of the toy that is solved in another way."""
    kernel = dataclasses.replace(TOY, methods=(dataclasses.replace(TOY.methods[1], solve=solve),))
    return dataclasses.replace(build(axes={"height": heights, **axes}), kernel=kernel)


def test_a_curve_is_interpolated_to_the_accuracy_asked_for_and_is_a_sweep_like_any_other():
    found = sweep.refine(foliot(mu=(1e-3, 1e5, 9)), "period", 1e-4)
    ds = found.dataset
    assert found.complete
    assert error_between(ds) < 1e-4
    assert found.error <= 1e-4
    assert ds.sizes["mu"] == 9 + found.added < found.uniform / 1.5
    steps = np.diff(np.log(ds.mu))
    assert (steps > 0).all()
    assert found.uniform == round(steps.sum() / steps.min()) + 1
    assert found.unseen == {"mu": f"a factor {np.exp(steps.max()):.3g}"}
    for name, again in sweep.run(sweep.study(ds)).data_vars.items():
        np.testing.assert_array_equal(again, ds[name])


def test_a_surface_with_a_border_of_statuses():
    """The foliot does not start where R >= mu; towards that border its period diverges."""
    found = sweep.refine(foliot(mu=(0.1, 100.0, 7), R=(0.01, 10.0, 7)), ["period", "multiplier"], 2e-2, most_cells=8000)
    whole = found.dataset
    assert whole.sizes["cell"] < 4000
    assert found.jumps > 0
    assert found.error <= 2e-2
    cells = list(zip(whole.mu.values.tolist(), whole.R.values.tolist(), strict=True))
    assert cells == sorted(cells)
    assert {Status.OK, Status.NEVER_STARTS} <= set(whole.status.values.tolist())
    assert (abs(np.log(whole.R / whole.mu)) < 0.1).sum() > 60  # the border is followed
    fine = whole.isel(cell=np.flatnonzero((whole.status == 0) & (whole.R / whole.mu < 0.5)))
    guess = LinearNDInterpolator(np.log(np.stack([fine.mu, fine.R], axis=1)), np.log(fine.period.values))
    rng = np.random.default_rng(2)
    mu = np.exp(rng.uniform(np.log(1.0), np.log(90.0), 200))
    R = mu * np.exp(rng.uniform(np.log(0.02), np.log(0.1), 200))
    truth = sweep.run(kernel="foliot", axes={"mu": mu, "R": R}, fixed=FIXED, design="zip").period.values
    assert np.nanmax(abs(np.exp(guess(np.log(mu), np.log(R))) / truth - 1)) < 2e-2


def test_beside_a_border_of_statuses_a_curve_is_as_accurate_as_elsewhere():
    """The foliot does not start where mu <= R = 0.1."""
    found = sweep.refine(foliot(FIXED | {"R": 0.1}, mu=(1e-2, 1e4, 5)), "period", 1e-3)
    assert found.complete
    assert 0.1 < found.dataset.mu[found.dataset.status == 0].min() < 0.1 * 1.004
    assert error_between(found.dataset, R=0.1) < 1e-3


def test_where_it_diverges_beside_a_border_interpolated_values_are_marked():
    """There is no cycle beyond a border in k, towards which the sensitivity grows as the inverse square root."""
    keys = {"kernel": "foliot", "outputs": ["sensitivity"], "fixed": {"mu": 1.0, "phi0": 1.0, "R": 0.2}}
    ds = sweep.run(**keys, axes={"a": np.linspace(0.1, 2.0, 5), "k": np.linspace(0.1, 3.0, 5)})
    found = sweep.refine(ds, "sensitivity", 5e-2)
    at = {"a": np.append(np.linspace(0.1, 2.0, 40), 0.76169), "k": np.append(np.linspace(0.1, 3.0, 40), 1.83571)}
    between, truth = sweep.interpolated(found.dataset, at), sweep.run(**keys, axes=at)
    off = abs(between.sensitivity / truth.sensitivity - 1).values
    marked = (between.status == Status.INACCURATE).values
    assert found.jumps > 0
    assert marked[-1, -1]
    assert (off[np.isfinite(between.sensitivity.values) & ~marked] < 5e-2).all()
    assert (off <= between.error_bound.values)[marked & np.isfinite(off)].all()
    assert marked.sum() < 0.05 * marked.size


def shaped(curve, heights, status=lambda height: Status.OK):
    """A study of the toy whose time of fall is a curve over the height, and its sweep."""

    def solve(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said):
        fall_time[...] = curve(height)
        said[...] = status(height)

    study = own(solve, heights)
    return {"dataset": sweep.run(study), "y": "fall_time", "study": study}


def test_a_jump_is_told_apart_and_followed_to_a_millionth_of_a_step():
    curve = lambda height: np.where(height < 1.37, 1.0, 2.0) + 0.1 * height**2  # noqa: E731
    found = sweep.refine(**shaped(curve, np.linspace(1.0, 2.0, 9)), tolerance=1e-3)
    assert not found.complete
    assert 1 <= found.jumps < 10
    assert found.added < 80
    assert found.error <= 1e-3
    assert 0.125 * 2.0**-21 < np.diff(found.dataset.height).min() < 0.125 * 2.0**-19


def test_where_values_scatter_no_more_cells_are_added_and_the_scatter_is_told():
    """Noise of 1e-3 in half of the range; a wave and a pole have none."""
    rng = np.random.default_rng(2)

    def curve(height):
        noise = np.where(height > 1.5, 1e-3, 0.0) * rng.standard_normal(len(height))
        return 2.0 + np.tanh(300 * (height - 1.2)) / 4 + np.sin(6 * height) / 4 + noise

    found = sweep.refine(**shaped(curve, np.linspace(1.0, 2.0, 9)), tolerance=1e-4, most_cells=20_000)
    assert not found.complete
    assert found.added < 800
    assert 2e-4 < found.noise < 2e-3
    assert 1e-3 < found.error < 1e-2
    assert "scatter" in repr(found)
    height = np.linspace(1.0, 2.0, 5000)
    off = abs(np.interp(height, found.dataset.height, found.dataset.fall_time) - curve(height))
    assert off.max() < 1.5e-2
    for quiet in (lambda height: np.sin(40 * height) + 2, lambda height: abs(height - 1.3719) ** 0.5 - 0.5):
        found = sweep.refine(**shaped(quiet, np.linspace(1, 2, 9)), tolerance=5e-4)
        assert (found.noise, found.complete) == (0, True)


@pytest.mark.parametrize("pole", [lambda x: 1 / abs(x), lambda x: 1 / x, lambda x: 1 / x**2])
def test_beside_a_pole_cells_are_few_and_elsewhere_the_tolerance_is_met(pole):
    found = sweep.refine(**shaped(lambda height: pole(height - 1.3719), np.linspace(1, 2, 9)), tolerance=1e-2)
    assert found.added < 180  # of one sign 250 to 320 where edges are cut as often as at a jump
    assert found.jumps > 0
    assert not found.complete
    assert (found.noise, found.error <= 1e-2) == (0, True)
    height = np.linspace(1, 2, 4001)
    far = abs(height - 1.3719) > 0.02
    values = pole(found.dataset.height.values - 1.3719)
    scale = np.log if (values > 0).all() else lambda y: y / abs(values).max()
    off = np.interp(height, found.dataset.height, scale(found.dataset.fall_time.values)) - scale(pole(height - 1.3719))
    assert abs(off[far]).max() < 1e-2


def test_cells_do_not_depend_on_the_unit_of_the_output():
    """In another unit, 3 of the other, other digits are rounded, in all that is decided."""
    found = []
    for unit in (1.0, 3.0):

        def solve(height, v0, g, rtol, phase, fall_time, impact_speed, drop, said, unit=unit):
            with np.errstate(invalid="ignore"):
                fall_time[...] = unit * height / np.sqrt(height - v0)
            said[...] = np.where(height > v0, Status.OK, Status.NEVER_STARTS)

        study = own(solve, np.geomspace(0.1, 100.0, 7), v0=np.geomspace(0.01, 10.0, 7))
        ds = sweep.refine(sweep.run(study), "fall_time", 5e-2, study=study, most_cells=300).dataset
        found.append(list(zip(ds.height.values.tolist(), ds.v0.values.tolist(), strict=True)))
    assert found[0] == found[1]


def test_cells_that_are_inaccurate_are_on_no_border():
    status = lambda height: np.where(height < 1.37, Status.INACCURATE, Status.OK)  # noqa: E731
    found = sweep.refine(**shaped(np.sqrt, np.linspace(1.0, 2.0, 9), status), tolerance=1e-3)
    assert found.complete
    assert found.added < 10


def test_where_too_few_cells_are_allowed_the_worst_places_get_them():
    found = sweep.refine(foliot(mu=(1e-3, 1e3, 5)), "period", 1e-6, most_cells=16)
    assert not found.complete
    assert found.dataset.sizes["mu"] <= 16
    assert 1e-6 < found.error < 0.1  # with cells for the best places instead it is 0.7
    assert "allow more cells" in str(found)


def test_three_axes_take_fewer_cells_than_an_even_grid_of_the_same_accuracy():
    """The period depends on mu / (a^2 phi0): along two of three directions there is nothing to cut."""
    names = ("mu", "a", "phi0")
    found = sweep.refine(foliot(**dict.fromkeys(names, (0.1, 10.0, 4))), "period", 2e-2)
    places = dict(zip(names, 10 ** np.random.default_rng(4).uniform(-1, 1, (3, 7)), strict=True))
    truth = sweep.run(kernel="foliot", axes=places, outputs=["period"]).period
    assert found.complete
    assert abs(sweep.interpolated(found.dataset, places).period / truth - 1).max() <= found.error
    assert found.dataset.sizes["cell"] < 200  # against 512 of an even grid with a larger error


def test_traces_are_kept_for_every_cell():
    axes = {"height": np.geomspace(1.0, 1e4, 5), "v0": [0.5, 1.0, 2.0]}
    keys = {"outputs": ["fall_time", "drop"], "along": {"phase": [0.0, 0.5, 1.0]}}
    coarse = sweep.run(build(axes=axes, **keys))
    found = sweep.refine(coarse, "fall_time", 1e-2, study=build(axes=axes, **keys)).dataset
    again = sweep.run(build(axes={name: found[name].values for name in axes}, design="zip", **keys))
    np.testing.assert_array_equal(found["drop"], again["drop"])
    np.testing.assert_allclose(found["drop"][:, 2], found.height, rtol=1e-14)


@pytest.mark.parametrize(
    ("axes", "keys", "options", "word"),
    [
        ({}, {}, {"y": "periods"}, "periods"),
        ({}, {}, {"y": "status"}, "not an output"),
        ({}, {}, {"y": []}, "one output"),
        ({}, {}, {"y": 3}, "not an output"),
        ({}, {}, {"y": None}, "y: expected"),
        ({}, {}, {"study": 3}, "expected a study"),
        ({}, {}, {"y": ["period", "mu"]}, "not an output"),
        ({}, {}, {"tolerance": 0.0}, "between 0 and 1"),
        ({}, {}, {"tolerance": "0.1"}, "a number"),
        ({}, {}, {"most_cells": "a"}, "whole number"),
        ({"method": ["auto"]}, {}, {}, "axes of numbers"),
        ({"mu": [1.0]}, {}, {}, "two values"),
        ({"mu": [1.0, np.nan]}, {}, {}, "finite"),
        ({"mu": [1.0, np.inf]}, {}, {}, "finite"),
        ({}, {"design": "zip"}, {}, "product"),
        ({}, {"summary": {}}, {}, "no cells"),
        ({name: [0.1, 0.2] for name in ("R", "c", "k", "a", "n")}, {}, {}, "at most 5 axes"),
    ],
)
def test_what_cannot_be_refined_is_told(axes, keys, options, word):
    axes = {"mu": [1.0, 2.0], **axes}
    fixed = {name: value for name, value in FIXED.items() if name not in axes}
    ds = sweep.run(kernel="foliot", axes=axes, fixed=fixed, outputs=["period"], **keys)
    with pytest.raises(sweep.SweepError, match=word):
        sweep.refine(ds, **{"y": "period", "tolerance": 0.1, **options})


def test_where_a_condition_does_not_hold_no_cell_is_solved():
    """A round of cuts may lie beyond its border as a whole."""
    ds = sweep.run(kernel="foliot", outputs=["period"], axes={"mu": [1.0, 2.0, 3.0]}, fixed=FIXED, where="mu > 1.5")
    found = sweep.refine(ds, "period", 1e-3)
    asked = found.dataset.mu > 1.5
    assert (found.dataset.status == xr.where(asked, Status.OK, Status.NOT_ASKED)).all()
    assert asked.sum() > 3
    assert found.error < 1e-3


def test_the_bits_do_not_depend_on_workers_or_on_a_file(tmp_path):
    ds = foliot(mu=(1e-1, 1e2, 5), R=(1e-3, 1e-2, 4))
    inside = sweep.refine(ds, "period", 3e-2, workers=1).dataset
    with sweep.refine(ds, "period", 3e-2, workers=3, path=tmp_path / "fine.h5").dataset as stored:
        for name in ("mu", "R", "period", "multiplier", "status"):
            np.testing.assert_array_equal(inside[name], stored[name])
    assert [path.name for path in tmp_path.iterdir()] == ["fine.h5"]
    assert sweep.verify(tmp_path / "fine.h5").whole
    another = sweep.study(kernel="foliot", axes={"mu": [1.0, 1.5, 2.0]}, fixed=FIXED, outputs=["period"], title="Else")
    kept = tmp_path / "fine.h5.rounds" / "1.h5"
    kept.parent.mkdir()
    kept.touch()
    with pytest.raises(sweep.SweepError, match="--force"):
        sweep.refine(sweep.run(another), "period", 0.1, path=tmp_path / "fine.h5")
    assert kept.exists()
    sweep.refine(sweep.run(another), "period", 0.1, path=tmp_path / "fine.h5", force=True).dataset.close()
    assert [path.name for path in tmp_path.iterdir()] == ["fine.h5"]


def test_a_refinement_that_was_stopped_computes_no_round_again(tmp_path):
    solved, stops, path, rounds = [], [signal.SIGINT], tmp_path / "fine.h5", tmp_path / "fine.h5.rounds"

    def counted(height, *rest):
        solved.extend(height.tolist())
        exact(height, *rest)
        if stops and len(list(rounds.glob("*.h5"))) == 2:
            signal.raise_signal(stops.pop())

    study = own(counted, np.geomspace(1.0, 1e4, 4))
    study = dataclasses.replace(study, fixed={**study.fixed, "v0": 3.0})
    ds = sweep.run(study)
    whole = sweep.refine(ds, "fall_time", 1e-3, study=study).dataset
    with pytest.raises(KeyboardInterrupt):
        sweep.refine(ds, "fall_time", 1e-3, study=study, path=path)
    done = [sweep.open_result(file, strict=True).height.values for file in rounds.glob("*.h5")]
    solved.clear()
    with sweep.refine(ds, "fall_time", 1e-3, study=study, path=path).dataset as found:
        np.testing.assert_array_equal(found.fall_time, whole.fall_time)
    assert len(done) == 2
    assert not set(np.concatenate(done)) & set(solved)
    assert not rounds.exists()


def test_a_refined_result_is_taken_by_every_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    keys = {"kernel": "foliot", "fixed": FIXED, "outputs": ["period", "multiplier"]}
    sweep.run(**keys, axes={"mu": np.geomspace(0.1, 100, 13), "R": np.geomspace(1e-2, 10, 6)}, path="coarse.h5").close()
    for line in (
        "refine coarse.h5 --y period --tolerance 5e-2 -o fine.h5 --most-cells 1500",
        "verify fine.h5",
        "fit fine.h5 --y period --x mu --window 20 100",
        "diff fine.h5 fine.h5",
        "plot fine.h5",
        "report fine.h5",
        "export fine.h5 -o fine.csv",
        "refine fine.h5 --y period --tolerance 4e-2 -o finer.h5 --most-cells 2000",
    ):
        assert main(line.split()) == 0, line
    printed = capsys.readouterr().out
    slopes = [row.split() for row in printed.splitlines() if row.startswith("  0.01 ")]
    assert float(slopes[0][4]) == pytest.approx(-0.33, abs=0.05)
    with sweep.open_result("fine.h5") as fine, sweep.open_result("finer.h5") as finer:
        cells = [set(zip(one.mu.values, one.R.values, strict=True)) for one in (fine, finer)]
    assert cells[0] <= cells[1]
    assert len(cells[1]) <= 2000
