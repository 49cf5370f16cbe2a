"""`sweep check` finds what is beyond rtol, and nothing else; `sweep cell` says of a cell what the result says."""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import toy
import xarray as xr
from running import same
from toy_studies import build

import sweep
from kernels.interface import Method, Status
from sweep.cells.sample import sampled

FOLIOT = {
    "kernel": "foliot",
    "outputs": ["period", "amplitude"],
    "rtol": 1e-7,
    "axes": {"mu": np.geomspace(0.3, 30.0, 12), "R": [0.0, 0.1]},
    "fixed": {"phi0": 1.0, "a": 1.0},
}


@pytest.fixture(scope="module")
def clocks():
    return sweep.run(FOLIOT)


def test_an_honest_result_is_judged_by_other_methods_and_has_nothing_beyond(clocks):
    found = clocks.sweep.check()
    assert (found.cells, found.sample, found.judged, found.by_another) == (24, 24, 24, 24)
    assert (found.beyond, found.limit) == (0, 0.0)
    assert " at :" not in str(clocks.isel(mu=3, R=1).sweep.check())
    some = clocks.sweep.check(sample=10)
    assert (some.judged, some.beyond) == (10, 0)
    assert some.limit == pytest.approx(1 - 0.05**0.1)  # the share of which none is drawn in ten with 5 %
    assert clocks.sweep.check(sample=10, seed=1).worst["cell"] != some.worst["cell"]


@pytest.mark.parametrize("output", FOLIOT["outputs"])
def test_a_cell_that_is_off_by_more_than_rtol_is_found(clocks, output):
    wrong = clocks.copy(deep=True)
    wrong[output][3, 1] *= 1 + 3e-7
    wrong[output][5, 0] *= 1 + 0.5e-7
    found = wrong.sweep.check()
    assert found.beyond == 1
    assert found.worst["output"] == output
    assert found.worst["off"] == pytest.approx(3.0, rel=0.01)
    assert float(found.worst["cell"]["mu"]) == pytest.approx(clocks.mu.values[3], rel=1e-5)
    assert found.worst["cell"]["R"] == "0.1"
    assert wrong.isel(mu=slice(4, None)).sweep.check().beyond == 0
    assert wrong.sweep.where("mu < 5").sweep.check().beyond == 1


def test_a_method_and_an_rtol_that_are_axes_are_those_of_the_cell(clocks):
    keys = {**FOLIOT, "axes": {"mu": [1.0, 2.0], "method": ["closed", "asymptotic"], "rtol": [1e-9, 1e-3]}}
    del keys["rtol"]
    ds = sweep.run(keys)
    found = ds.sweep.check()
    assert found.beyond == 0
    report = ds.sweep.cell(mu=1.0, method="asymptotic", rtol=1e-3)
    assert (report.method, report.rtol) == ("asymptotic", 1e-3) if report.status == Status.OK else ("none", 1e-3)


def test_a_cell_is_what_the_result_and_each_method_say(clocks):
    report = clocks.sweep.cell(mu=0.3, R=0.1)
    cell = clocks.sel(mu=0.3, R=0.1)
    assert report.values == {name: cell[name].item() for name in FOLIOT["outputs"]}
    assert report.status == cell.status.item()
    assert report.error_bound == cell.error_bound.item()
    assert "closed" not in report.methods  # which cannot do dry friction
    status, error, values = report.methods[report.method]
    assert (status, values) == (report.status, report.values)
    assert error == np.float32(report.error_bound)
    wrong = clocks.copy(deep=True)
    wrong["period"].loc[{"mu": 0.3, "R": 0.1}] *= 2
    wrong["amplitude"].loc[{"mu": 0.3, "R": 0.1}] *= 0.8
    told = wrong.sweep.cell(mu=0.3, R=0.1)
    assert told.differs[told.method] == pytest.approx(0.5)
    assert re.search(rf"^  {told.method} +OK +\S+ +0\.5$", str(told), re.MULTILINE)
    none = clocks.assign({name: clocks[name] * np.nan for name in FOLIOT["outputs"]}).sweep.cell(mu=0.3, R=0.1)
    assert re.search(rf"^  {none.method} +OK +\S+ +inf$", str(none), re.MULTILINE)
    refused = sweep.run(FOLIOT | {"axes": {"mu": [1e-3], "R": [0.1]}}).sweep.cell()
    assert refused.status == Status.NEVER_STARTS
    assert {status for status, *_ in refused.methods.values()} == {Status.NEVER_STARTS}


def test_a_count_of_steps_is_no_difference_of_methods():
    keys = {"kernel": "foliot_steps", "method": "rk4", "outputs": ["period", "steps"], "axes": {"mu": [1.0]}}
    report = sweep.run(keys | {"fixed": {"phi0": 1.0, "a": 1.0, "step": 0.05}}).sweep.cell()
    others = [values for status, _, values in report.methods.values() if values["steps"] != report.values["steps"]]
    assert others
    assert report.differs.keys() == report.methods.keys()
    assert max(report.differs.values()) < 0.1


def test_what_is_no_cell_is_refused(clocks):
    keys = {"kernel": "foliot_steps", "method": "rk4", "outputs": ["steps"], "rtol": 0.01, "axes": {"mu": [1.0]}}
    summary = sweep.run(build(axes={"height": [1.0, 2.0]}, summary={"outputs": {"fall_time": ["mean"]}}))
    for look, word in (
        (lambda: sweep.run(keys | {"fixed": {"phi0": 1.0, "a": 1.0, "step": 0.05}}).sweep.check(), "compared"),
        (lambda: clocks.sweep.cell(R=0.1), "mu"),
        (lambda: clocks.assign_coords(phi0=clocks.phi0.assign_attrs(units="degree")).sweep.check(), "unit"),
        (lambda: clocks.drop_vars("phi0").sweep.check(), "phi0"),
        (lambda: clocks.sweep.check(seed=-1), "seed"),
        (lambda: clocks.sweep.check(sample="a"), "sample"),
        (lambda: clocks.where(False).assign(status=clocks.status * 0 + 64).sweep.check(), "OK"),
        (lambda: summary.sweep.check(allow_import=True), "summary"),
        (lambda: summary.sweep.cell(allow_import=True), "summary"),
    ):
        with pytest.raises(sweep.SweepError, match=word):
            look()


def test_traces_are_judged_and_differ_relative_to_their_amplitude():
    keys = {"kernel": "foliot_motion", "outputs": ["angle"], "along": {"phase": [0.1, 0.4]}}
    ds = sweep.run(keys | {"axes": {"mu": [0.5]}, "fixed": {"phi0": 1.0, "a": 0.3}})
    found = ds.sweep.check()
    assert (found.judged, found.sample, found.beyond) == (1, 1, 0)
    assert "segments" in str(ds.sweep.cell())
    differs = ds.assign(angle=ds.angle * 0.8).sweep.cell().differs
    assert differs == pytest.approx(dict.fromkeys(differs, 0.25), rel=1e-3)


def test_the_worst_of_a_list_that_nan_fills_up_is_a_number():
    keys = {"kernel": "drivetrain", "outputs": ["frequency"], "axes": {"n_keep": [1, 2]}}
    ds = sweep.run(keys | {"fixed": {"J": [1.0, 2.0, 4.0], "k": [1e3, 2e3, 0.0]}})
    found = ds.assign(frequency=ds.frequency * 1.1).sweep.check()
    (_, old), (_, new) = found.worst["values"]
    assert (found.beyond, old) == (2, pytest.approx(1.1 * new))


def test_a_scene_whose_parameters_all_have_defaults_is_asked_again_and_what_is_0_to_rounding_is_the_same():
    keys = {"kernel": "kicked_scene:KICKED", "fixed": {"kick": 1.0}, "allow_import": True, "outputs": ["period", "x"]}
    assert sampled(sweep.study(**keys, axes={"rtol": [1e-6, 1e-3]}), 5).axes["zeta"].values.tolist() == [0.0]
    ds = sweep.run(sweep.study(**keys, axes={"zeta": [0.1]}, rtol=1e-6))
    assert ds.sweep.check(allow_import=True).beyond == 0
    report = ds.sweep.cell(allow_import=True)
    assert abs(report.values["x"]) < 1e-15
    for x in (-ds.x - 1e-17, 1.05 * ds.x + 1e-30):  # by chance it may be almost what one method gives
        report = ds.assign(x=x).sweep.cell(allow_import=True)
        assert report.differs[report.method] == pytest.approx(0, abs=1e-12)


def test_deviations_of_a_small_motion_are_those_of_the_same_motion_in_larger_units():
    keys = {"kernel": "kicked_scene:SECTION", "allow_import": True, "along": {"passage": [1, 2, 3]}, "rtol": 1e-6}
    ds = sweep.run(sweep.study(**keys, axes={"zeta": [0.1, 0.2]}, fixed={"kick": 1e-13, "v0": 3e-13}))
    assert ds.sweep.check(allow_import=True).beyond == 0
    assert ds.assign(x=ds.x + 1e-12).sweep.check(allow_import=True).beyond == 2
    found = ds.assign(v=ds.v * 1.5).sweep.check(allow_import=True)
    assert (found.beyond, found.worst["output"]) == (2, "v")


def test_a_dataset_without_statuses_says_what_can_be_done_with_it():
    plain = xr.Dataset({"y": ("x", [1.0])})
    assert "in_units" in repr(plain.sweep)
    for use in (plain.sweep.statuses, lambda: sweep.where(plain, "y > 0"), lambda: sweep.diff(plain, plain)):
        with pytest.raises(sweep.SweepError, match="not a result"):
            use()
    summary = sweep.run(build(axes={"height": [1.0, 2.0]}, summary={}))
    assert re.search(r"^  2 +OK ", repr(summary.sweep), re.MULTILINE)


def test_outputs_that_are_infinite_by_both_methods_agree():
    fixed = {"I_c": 1e-4, "I_v": 1e-5, "r_c": 0.05, "r_v": 0.01, "teeth": 31, "h": 1e-3, "e": 0.1}
    found = sweep.run(kernel="impact", axes={"torque": [1e-3, 1e-2]}, fixed=fixed)
    assert np.isinf(found.impacts).all()
    assert found.sweep.check().beyond == 0


def test_xarray_opens_a_result_as_one_of_ours(clocks, tmp_path):
    """`ds.sweep` is there in a program that never imports sweep, and chunks are dask's where they are asked for."""
    with sweep.run(FOLIOT, tmp_path / "clocks.h5", block_cells=24):
        pass
    script = "import xarray as xr; ds = xr.open_dataset('clocks.h5'); print(ds.sweep.check(sample=3).beyond)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout == "0\n"
    with (
        xr.open_dataset(tmp_path / "clocks.h5", engine="sweep", drop_variables="amplitude", chunks={}) as ours,
        sweep.open_result(tmp_path / "clocks.h5", chunks={}) as opened,
    ):
        assert ours.chunks == opened.chunks == {"mu": (12,), "R": (2,)}
        assert ours.period.identical(opened.period)
        assert "amplitude" not in ours
        assert opened.period.equals(clocks.period)


def test_the_study_of_a_long_axis_is_whole_for_plain_xarray_too_and_two_of_them_are_joined(tmp_path):
    """Its values stand in the file once, as the coordinate."""
    mu = np.geomspace(0.3, 30.0, 3000)
    for part in (0, 1):
        with sweep.run(FOLIOT | {"axes": {"mu": mu[part::2]}}, tmp_path / f"{part}.h5") as written:
            study = sweep.study(written)
    with (
        xr.open_dataset(tmp_path / "0.h5", engine="h5netcdf") as even,
        xr.open_dataset(tmp_path / "1.h5", engine="h5netcdf") as odd,
    ):
        assert sweep.study(odd) == study
        assert odd.sweep.check(sample=2).beyond == 0
        same(sweep.join(even, odd), sweep.run(FOLIOT | {"axes": {"mu": mu}}))
        for part in (slice(10), slice(150), 3):  # of 1500
            with pytest.raises(sweep.SweepError, match="mu"):
                sweep.study(odd.isel(mu=part))


def test_a_value_where_another_method_finds_that_there_is_none_is_beyond(clocks):
    """Below R nothing starts; a result that says OK there is wrong, whatever its values."""
    fixed = {name: clocks[name].item() for name in ("phi0", "a")}
    refused = sweep.run(FOLIOT | {"axes": {"mu": [0.05, 1.0], "R": [0.1]}, "fixed": fixed})
    false = refused.assign(
        {name: refused[name].fillna(1.0) for name in FOLIOT["outputs"]}
        | {"status": refused.status * 0, "method_used": refused.method_used.isel(mu=[1, 1]).drop_vars("mu")}
    )
    found = false.sweep.check()
    assert (found.judged, found.by_another, found.beyond) == (2, 2, 1)
    assert found.worst["off"] == np.inf


def test_where_another_method_overflows_it_has_no_opinion(monkeypatch):
    """As an explicit one in a stiff cell, which it takes for OUT_OF_RANGE."""

    def explicit(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        status[...] = Status.OUT_OF_RANGE

    methods = toy.KERNEL.methods[1], Method("explicit", "", explicit)
    monkeypatch.setattr(toy, "STIFF", replace(toy.KERNEL, methods=methods), raising=False)
    found = sweep.run(build(kernel="toy:STIFF", axes={"height": [1.0]})).sweep.check(allow_import=True)
    assert (found.by_another, found.beyond) == (0, 0)
