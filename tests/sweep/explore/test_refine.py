"""Refined sweeps: interpolation as right as asked, borders followed, fewer cells than an even grid."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator
from toy import KERNEL as TOY

import sweep
from kernels.interface import Status
from sweep.analysis.metric import stretch
from sweep.analysis.scattered import located
from sweep.cli import main
from sweep.explore.refine import _Output
from sweep.system.errors import SweepError


def foliot(**axes):
    keys = {name: {"spacing": "log", "start": a, "stop": b, "num": n} for name, (a, b, n) in axes.items()}
    return sweep.study(kernel="foliot", axes=keys, fixed={"phi0": 1.0, "a": 1.0}, outputs=["period", "multiplier"])


def toy(heights, v0):
    keys = {"axes": {"height": heights, "v0": v0}, "outputs": ["fall_time"]}
    return sweep.study(kernel="toy:KERNEL", allow_import=True, **keys)


def test_a_curve_is_interpolated_as_right_as_asked():
    study = foliot(mu=(1e-3, 1e5, 9))
    found = sweep.refine(sweep.run(study), "period", 1e-4)
    assert found.complete
    assert found.error <= 1e-4
    ds = found.dataset.sortby("mu")
    mu = np.exp(np.random.default_rng(1).uniform(np.log(1e-3), np.log(1e5), 300))
    truth = sweep.run(sweep.study(kernel="foliot", axes={"mu": mu}, fixed={"phi0": 1.0, "a": 1.0})).period
    guess = np.exp(np.interp(np.log(mu), np.log(ds.mu.values), np.log(ds.period.values)))
    assert float(abs(guess / truth - 1).max()) < 1e-4
    assert found.dataset.sizes["mu"] < found.uniform / 1.5
    assert found.dataset.sizes["mu"] == 9 + found.added


def test_a_tighter_tolerance_costs_more_cells_as_the_square_root():
    ds = sweep.run(foliot(mu=(1e-3, 1e5, 9)))
    few, many = (sweep.refine(ds, "period", tolerance).added for tolerance in (1e-3, 1e-5))
    assert 6 < many / few < 16


def test_a_surface_with_a_border_of_statuses():
    """period over mu and R: no start where R >= mu."""
    study = foliot(mu=(0.1, 100.0, 7), R=(0.01, 10.0, 7))
    ds = sweep.run(study)
    found = sweep.refine(ds, ["period", "multiplier"], 2e-2, most_cells=8000)  # the period diverges at the border
    whole = found.dataset
    assert whole.sizes["cell"] < 4000  # which is not followed to infinity
    assert found.singular > 0
    assert found.error <= 2e-2
    assert "nearest a border of statuses, where values diverge" in str(found)
    assert {0, 65} <= set(whole.status.values.tolist())
    near = abs(np.log(whole.R / whole.mu)) < 0.1
    assert int(near.sum()) > 60  # the border is followed
    fine = whole.isel(cell=np.flatnonzero((whole.status == 0) & (whole.R / whole.mu < 0.5)))
    guess = LinearNDInterpolator(np.log(np.stack([fine.mu, fine.R], axis=1)), np.log(fine.period.values))
    rng = np.random.default_rng(2)
    mu = np.exp(rng.uniform(np.log(1.0), np.log(90.0), 200))
    R = mu * np.exp(rng.uniform(np.log(0.02), np.log(0.1), 200))
    keys = {"fixed": {"phi0": 1.0, "a": 1.0}, "design": "zip"}
    truth = sweep.run(sweep.study(kernel="foliot", axes={"mu": mu, "R": R}, **keys)).period.values
    off = abs(np.exp(guess(np.log(mu), np.log(R))) / truth - 1)
    assert np.nanmax(off) < 2e-2


def test_beside_a_border_of_statuses_a_curve_is_interpolated_as_right_as_elsewhere():
    """No start where mu <= R = 0.1; above, the period diverges."""
    keys = {"fixed": {"phi0": 1.0, "a": 1.0, "R": 0.1}, "outputs": ["period"]}
    axis = {"spacing": "log", "start": 1e-2, "stop": 1e4, "num": 5}
    found = sweep.refine(sweep.run(sweep.study(kernel="foliot", axes={"mu": axis}, **keys)), "period", 1e-3)
    assert found.complete
    ds = found.dataset.isel(mu=np.flatnonzero(found.dataset.status == 0)).sortby("mu")
    assert 0.1 < float(ds.mu[0]) < 0.1 * 1.1  # the border is followed
    mu = np.exp(np.random.default_rng(1).uniform(np.log(ds.mu.values[0]), np.log(1e4), 500))
    truth = sweep.run(sweep.study(kernel="foliot", axes={"mu": mu}, **keys)).period
    guess = np.exp(np.interp(np.log(mu), np.log(ds.mu.values), np.log(ds.period.values)))
    assert float(abs(guess / truth - 1).max()) < 1e-3


def test_a_grid_that_is_fine_enough_stays_as_it_is():
    study = toy([1.0, 2.0, 4.0, 8.0], [1e-9, 2e-9, 4e-9])
    ds = sweep.run(study)
    found = sweep.refine(ds, "fall_time", 1e-3, study=study)
    assert found.added == 0
    assert found.dataset.sizes["cell"] == 12
    np.testing.assert_array_equal(found.dataset.fall_time, ds.fall_time.values.ravel())
    assert found.complete
    assert found.error < 1e-8


def test_cells_are_added_where_it_bends_alone():
    """height / v0 turns into sqrt(2 height / g) about height = v0^2 / 2 g = 51 m."""
    keys = {"kernel": "toy:KERNEL", "allow_import": True, "outputs": ["fall_time"], "fixed": {"v0": 31.6}}
    study = sweep.study(axes={"height": 50 * 10.0 ** np.arange(-6, 7)}, **keys)
    ds = sweep.run(study)
    found = sweep.refine(ds, "fall_time", 3e-2, study=study)
    added = sorted(set(found.dataset.height.values) - set(ds.height.values))
    assert found.complete
    assert found.added > 0
    assert 5e-3 < added[0] < added[-1] < 5e5  # the grid reaches from 5e-5 to 5e7


def test_joined_cells_are_those_of_a_study_and_can_be_run_again():
    found = sweep.refine(sweep.run(foliot(mu=(1e-3, 1e3, 5))), "period", 1e-2)
    study = sweep.study(found.dataset)
    again = sweep.run(study)
    np.testing.assert_array_equal(again.period, found.dataset.period)
    assert (np.diff(found.dataset.mu) > 0).all()


def test_too_few_cells_allowed_is_told():
    found = sweep.refine(sweep.run(foliot(mu=(1e-3, 1e3, 5))), "period", 1e-6, most_cells=40)
    assert not found.complete
    assert found.dataset.sizes["mu"] <= 40
    assert "allow more cells" in str(found)
    assert found.error > 1e-6  # what is left is told


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"y": "periods"}, "periods"),
        ({"tolerance": 0.0}, "between 0 and 1"),
        ({"axes": {"method": ["auto"]}}, "number axes"),
        ({"axes": {"mu": [2.0, 1.0]}}, "rising"),
        ({"design": "zip"}, "product"),
    ],
)
def test_what_cannot_be_refined_is_told(change, message):
    axes = {"mu": [1.0, 2.0], **change.get("axes", {})}
    keys = {"fixed": {"phi0": 1.0, "a": 1.0}, "design": change.get("design", "product")}
    ds = sweep.run(sweep.study(kernel="foliot", axes=axes, **keys))
    with pytest.raises(SweepError, match=message):
        sweep.refine(ds, change.get("y", "period"), change.get("tolerance", 0.1))


def test_the_command_writes_a_result_like_any_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sweep.run(foliot(mu=(1e-2, 1e3, 6)), "coarse.h5")
    command = ["refine", "coarse.h5", "--y", "period", "--tolerance", "1e-2", "-o", "fine.h5"]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert "an even grid as fine has" in told
    assert main(["verify", "fine.h5"]) == 0
    ds = sweep.open_result("fine.h5", strict=True)
    inside = sweep.refine(sweep.open_result("coarse.h5"), "period", 1e-2).dataset
    np.testing.assert_array_equal(ds.period, inside.period)
    np.testing.assert_array_equal(ds.mu, inside.mu)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["coarse.h5", "fine.h5"]
    again = sweep.run(sweep.study(ds), "again.h5")
    np.testing.assert_array_equal(again.period, ds.period)
    assert main(command) == 0  # done before; nothing is lost by asking twice


def test_a_refinement_that_was_stopped_takes_up_its_rounds(tmp_path, monkeypatch):
    import sweep.runs.run

    monkeypatch.chdir(tmp_path)
    ds = sweep.run(foliot(mu=(1e-2, 1e3, 6)))
    stored = sweep.runs.run.store_cells
    monkeypatch.setattr("sweep.runs.run.store_cells", lambda *given, **named: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        sweep.refine(ds, "period", 1e-2, path="fine.h5")
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "fine.h5.rounds").iterdir()}
    assert before
    monkeypatch.setattr("sweep.runs.run.store_cells", stored)
    monkeypatch.setattr("sweep.explore.refine.shutil.rmtree", lambda *given, **keys: None)
    sweep.refine(ds, "period", 1e-2, path="fine.h5")
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "fine.h5.rounds").iterdir()} == before


def test_a_fine_grid_is_judged_before_anything_is_computed():
    """1,401 cells: every second one of them proves 5e-5, by straight lines."""
    ds = sweep.run(foliot(mu=(1e-3, 1e4, 1401)))
    coarse = ds.isel(mu=slice(None, None, 2))
    guess = np.exp(np.interp(np.log(ds.mu), np.log(coarse.mu), np.log(coarse.period)))
    assert float(abs(guess / ds.period - 1).max()) < 5e-5
    found = sweep.refine(ds, "period", 1e-4)
    assert found.added == 0
    assert found.complete
    assert found.error < 5e-5


def test_three_axes_take_fewer_cells_than_an_even_grid_that_is_as_right():
    """P depends on mu / (a^2 phi0): along two of three directions there is nothing to cut."""

    def even(num):
        axes = {n: {"spacing": "log", "start": 0.1, "stop": 10, "num": num} for n in ("mu", "a", "phi0")}
        return sweep.run(sweep.study(kernel="foliot", axes=axes, outputs=["period"]))

    names = ("mu", "a", "phi0")
    places = 10 ** np.random.default_rng(4).uniform(-1, 1, (3, 400))
    keys = {"axes": dict(zip(names, places, strict=True)), "design": "zip", "outputs": ["period"]}
    truth = sweep.run(sweep.study(kernel="foliot", **keys)).period.values

    def off(points, period):
        corners, shares = located(points, np.log(places.T))
        return abs(np.exp((shares * np.log(period)[corners]).sum(axis=1)) / truth - 1).max()

    found = sweep.refine(even(4), "period", 2e-2)
    points = np.log(np.stack([found.dataset[n].values for n in names], axis=1))
    period = found.dataset.period.values
    stretched = stretch((points - points.min()) / np.ptp(points), np.log(period))
    corners, shares = located(points @ stretched, np.log(places.T) @ stretched)
    true = abs(np.exp((shares * np.log(period)[corners]).sum(axis=1)) / truth - 1).max()
    assert found.complete
    assert true <= found.error
    assert len(period) < 200
    grid = even(8)
    rows = np.log(np.stack([m.ravel() for m in np.meshgrid(*(grid[n] for n in names), indexing="ij")], axis=1))
    assert off(rows, grid.period.values.ravel()) > true  # 512 cells


def test_an_axis_that_matters_nothing_is_hardly_cut():
    """A power law in phi0 at a fixed mu / (a^2 phi0): over 1 % of phi0 all that bends is mu.

    Twice the cells of mu alone are the least, for both ends of phi0 need them.
    """

    def cells(**more):
        axes = {"mu": {"spacing": "log", "start": 1e-2, "stop": 1e2, "num": 5}, **more}
        fixed = {"a": 1.0, "phi0": 1.0}
        fixed = {name: value for name, value in fixed.items() if name not in axes}
        ds = sweep.run(sweep.study(kernel="foliot", axes=axes, fixed=fixed, outputs=["period"]))
        found = sweep.refine(ds, "period", 1e-3)
        assert found.complete
        return found.dataset.sizes

    alone = cells()["mu"]
    both = cells(phi0={"spacing": "linear", "start": 1.0, "stop": 1.01, "num": 3})["cell"]
    assert both < 3 * alone


def test_between_two_values_of_an_axis_a_third_is_computed_first():
    found = sweep.refine(sweep.run(foliot(mu=(1e-2, 1e2, 2))), "period", 1e-2)
    assert found.complete
    assert found.added > 5
    assert 1.0 in found.dataset.mu.values.round(12)


def test_what_cannot_be_seen_is_said():
    found = sweep.refine(sweep.run(foliot(mu=(1e-2, 1e2, 9))), "period", 1e-2)
    assert "a peak narrower than that is not seen" in str(found)
    mu = found.dataset.mu.values
    assert found.unseen == {"mu": f"a factor {(mu[1:] / mu[:-1]).max():.3g}"}


def test_a_jump_is_told_from_what_more_cells_would_mend():
    kernel = dataclasses.replace(TOY, methods=(dataclasses.replace(TOY.methods[1], solve=_stepped),))
    keys = {"axes": {"height": np.linspace(1.0, 2.0, 9)}, "outputs": ["fall_time"], "allow_import": True}
    study = dataclasses.replace(sweep.study(kernel="toy:KERNEL", **keys), kernel=kernel)
    found = sweep.refine(sweep.run(study), "fall_time", 1e-3, study=study)
    assert not found.complete
    assert 1 <= found.jumps < 10  # those beside it, too
    assert found.error <= 1e-3
    assert "where it jumps or diverges" in str(found)
    height = found.dataset.height.values
    assert np.diff(height).min() < 1e-6


def _stepped(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
    fall_time[...] = np.where(height < 1.37, 1.0, 2.0) + 0.1 * height**2
    status[...] = 0


def test_a_refined_result_of_two_axes_is_taken_by_every_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sweep.run(foliot(mu=(1e-1, 1e2, 13), R=(1e-2, 10.0, 6)), "coarse.h5").close()
    command = "refine coarse.h5 --y period --tolerance 5e-2 -o fine.h5 --most-cells 1500"
    assert main(command.split()) == 0
    for more in (
        "verify fine.h5",
        "show fine.h5",
        "fit fine.h5 --y period --x mu --window 20 100",
        "fit fine.h5 --y period --x mu --at R=0.01",
        "fit fine.h5 --y period --x mu --at R=0.01 --compare",
        "diff fine.h5 fine.h5",
        "list .",
        "plot fine.h5",
        "plot fine.h5 --x mu -o points.png",
        "report fine.h5",
        "export fine.h5 -o fine.csv",
        "chart fine.h5 --cells 32 --rtol 1e-6",
        "refine fine.h5 --y period --tolerance 4e-2 -o finer.h5 --most-cells 2000",
    ):
        assert main(more.split()) == 0, more
    told = capsys.readouterr().out
    assert "cells are up to a factor" in told
    assert "an even grid" not in told  # of several axes, finest steps of all of them are in no one place
    assert "lines from end to end of mu; take one by --at, e.g. --at R=" in told
    assert main(["fit", "fine.h5", "--y", "period", "--x", "mu", "--compare"]) == 2
    assert "take one by --at, e.g. --at R=" in capsys.readouterr().err
    fine, finer = sweep.open_result("fine.h5"), sweep.open_result("finer.h5")
    assert fine.sizes["cell"] <= finer.sizes["cell"] <= 2000
    both = set(zip(fine.mu.values, fine.R.values, strict=True)) - set(zip(finer.mu.values, finer.R.values, strict=True))
    assert not both  # nothing is lost
    lines = [line.split() for line in told.splitlines() if line.startswith("  0.01 ")]
    assert float(lines[0][4]) == pytest.approx(-0.33, abs=0.05)


def test_the_bits_do_not_depend_on_workers_or_where_rounds_are_kept(tmp_path):
    ds = sweep.run(foliot(mu=(1e-1, 1e2, 5), R=(1e-3, 1e-2, 4)))
    inside = sweep.refine(ds, "period", 3e-2, workers=1).dataset
    stored = sweep.refine(ds, "period", 3e-2, workers=3, path=tmp_path / "fine.h5").dataset
    for name in ("mu", "R", "period", "multiplier", "status"):
        np.testing.assert_array_equal(inside[name], stored[name])


def test_a_refinement_that_was_killed_on_its_way_computes_no_round_again(tmp_path, monkeypatch):
    ds = sweep.run(foliot(mu=(1e-2, 1e3, 6)))
    whole = sweep.refine(ds, "period", 1e-3).dataset
    solved, rounds = _Output.solved, []

    def stopped(self, axes):
        if len(rounds) == 3:
            raise KeyboardInterrupt
        rounds.append(axes)
        return solved(self, axes)

    monkeypatch.setattr(_Output, "solved", stopped)
    with pytest.raises(KeyboardInterrupt):
        sweep.refine(ds, "period", 1e-3, path=tmp_path / "fine.h5")
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "fine.h5.rounds").iterdir()}
    assert len(kept) == 3
    monkeypatch.setattr(_Output, "solved", solved)
    monkeypatch.setattr("sweep.explore.refine.shutil.rmtree", lambda *given, **keys: None)
    found = sweep.refine(ds, "period", 1e-3, path=tmp_path / "fine.h5").dataset
    assert {p: p.stat().st_mtime_ns for p in kept} == kept
    np.testing.assert_array_equal(found.period, whole.period)


def test_the_error_told_holds_the_truth(tmp_path):
    """Of random functions of one and two axes; `--functions 200` measures the share."""
    script = Path(__file__).parents[3] / "benchmarks/honesty/refine.py"
    command = [sys.executable, str(script), "--no-adaptive", "--functions", "20", "--axes", "1", "2"]
    found = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert found.returncode == 0, found.stdout + found.stderr


def test_where_a_refined_output_diverges_what_is_read_between_cells_is_marked(tmp_path):
    """No cycle beyond a border in k, towards which the sensitivity grows as the inverse root of the distance."""
    keys = {"kernel": "foliot", "outputs": ["sensitivity"], "fixed": {"mu": 1.0, "phi0": 1.0, "R": 0.2}}
    ds = sweep.run(**keys, axes={"a": np.linspace(0.1, 2.0, 5), "k": np.linspace(0.1, 3.0, 5)})
    found = sweep.refine(ds, "sensitivity", 5e-2, path=tmp_path / "refined.h5")
    at = {"a": np.append(np.linspace(0.1, 2.0, 40), 0.76169), "k": np.append(np.linspace(0.1, 3.0, 40), 1.83571)}
    with sweep.open_result(tmp_path / "refined.h5") as refined:
        between, truth = sweep.interpolated(refined, at), sweep.run(**keys, axes=at)
    off = abs(between.sensitivity / truth.sensitivity - 1).values
    marked = (between.status == Status.INACCURATE).values
    valued = np.isfinite(between.sensitivity.values)
    assert found.singular > 0
    assert marked[-1, -1]
    assert (off[valued & ~marked] < 5e-2).all()  # where there is no truth it is NaN, which fails
    assert (off <= between.error_bound.values)[marked & np.isfinite(off)].all()
    assert marked.sum() < 0.05 * marked.size
