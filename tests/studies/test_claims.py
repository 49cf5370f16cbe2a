"""What every study claims is so on a thinned grid, and false numbers in its results are noticed."""

import re
import tomllib
import warnings
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr
from _common import Statement, grouped, held, never, summary, what_came_out

import sweep
from kernels.lanes.jit import COMPILED

STUDIES = Path(__file__).parents[2] / "studies"
pytestmark = pytest.mark.skipif(not COMPILED, reason="whole studies; the kernels' own tests run as plain Python")


class Claims(NamedTuple):
    """What is run for a script, and what it does not speak of.

    Parameters
    ----------
    files : by study file, what stands instead of values there: every n-th of an axis, or a list of numbers [SI]; rtol
        (4e-10, so that of a scene one of the two orders of series is compiled for all that is asked of it);
        `where`: a condition, such as that a scene starts at all, where a slide that rests would be compiled for nothing
    silent : outputs, or those of one study, that no statement is made from; every other has a lie that is
        noticed
    still : of the statements that are checked, how many no lie about a result makes fail: those that the script
        concludes from motions that it follows itself, or from constants
    tell : False where the script can leave out what others cost
    """

    files: dict
    silent: str
    still: int = 0
    tell: bool = True


# fmt: off
TABLE = {
    "anchor": Claims({"anchor": {"mu": 2}}, "", 1),
    "balance_isochronism": Claims({
        "balance_isochronism": {"at": 8, "w": 4}, "balance_isochronism_lift": {"m": 2},
        "balance_isochronism_positions": {"w": 0.03 * 20 ** (np.array([*range(0, 17, 2), 17, 19, 20, 22, 24]) / 24)},
    },
        "balance_isochronism.angle balance_isochronism.interval balance_isochronism.time "
        "balance_isochronism_lift.multiplier balance_isochronism_lift.status "
        "balance_isochronism_positions.angle balance_isochronism_positions.interval "
        "balance_isochronism_positions.time"),
    "balance_ringdown": Claims({
        "balance_ringdown": {"zeta": np.geomspace(1e-4, 2, 31), "r": np.geomspace(1e-4, 0.9, 37)},
    }, "margin status stop_time", 2),
    "bouncing_ball": Claims({"bouncing_ball": {"push": [1.05, 1.2, 1.4, 1.53, 1.5375, 1.545, 1.6, 1.69]}}, ""),
    "chatter_lobes": Claims({"chatter_lobes": {}}, "damping frequency frequency_error", 1),
    "cross_beat": Claims({"cross_beat": {}}, ""),
    "foliot_scaling": Claims({
        "foliot_scaling": {"mu": np.geomspace(1e-7, 1e7, 169), "a": 1.3, "phi0": 0.4},
    }, "multiplier", 4),
    "friction_laws": Claims({
        "friction_laws": {"mu": np.geomspace(1e-24, 1e24, 385)},
        "friction_laws_map": {"R": np.geomspace(1e-3, 1e9, 61), "mu": np.geomspace(1e-3, 1e11, 141)},
    }, "friction_laws_map.amplitude friction_laws_map.period friction_laws_map.status", 1),
    "friction_varies": Claims({"friction_varies": {"rtol": 4e-10}, "friction_varies_noise": {}},
        "friction_varies.angle friction_varies.speed friction_varies.time "
        "friction_varies_noise.rate_error_s_per_day friction_varies_noise.truncated", 4),
    "fula_milling_machine": Claims({"fula_milling_machine": {}}, "frf_error n_kept status", 5),
    "hairspring": Claims({
        "hairspring": {"a": np.geomspace(1e-3, 10, 33), "k": np.geomspace(3e-6, 3e7, 105)},
    }, "amplitude multiplier", 8),
    "impact_map": Claims({
        "impact_map": {"I_c": 16, "e": 24}, "impact_map_lever": {"I_c": 16, "nu": 16},
    },
        "impact_map.contact_share impact_map.offset impact_map.status impact_map_lever.period "
        "impact_map_lever.swing", 3),
    "law_any_swing": Claims({"law_any_swing": {}}, "status"),
    "law_map": Claims({"law_map": {"e": [1, 0.99, 0.5], "R": [0, 1, 100], "c": [0, 1e-6, 1], "mu": 2}}, "status"),
    "law_map_overnight": Claims({
        "law_map_overnight": {"n": [0.25, 1.5, 3.0], "e": [1, 0.99, 0.97, 0.5], "R": 3, "c": 20},
        "law_map_borders": {},
    }, "sensitivity_max law_map_borders.amplitude law_map_borders.crossing_speed", 2),
    "losses_from_periods": Claims({"losses_from_periods": {}}, "", 11, tell=False),
    "origin_of_half": Claims({"origin_of_half": {"mu": 2}}, "amplitude status", 1),
    "polisher_design": Claims({
        "polisher_design": {"d": [0.3, 0.38], "b": 3, "f": 2, "e": 2},
    }, "rate_max rate_min status"),
    "polisher_extrema": Claims({"polisher_extrema": {
        "e": [0, 0.01, 0.02, 0.05, 0.08, 0.1, 0.12, 0.14, 0.15, 0.16, 0.1648, 0.1649, 0.165, 0.17, 0.18],
    }}, "A0_e rate_max rate_min theta_lock", 2),
    "polisher_robust": Claims({"polisher_robust": {}}, "wear_error", 8),
    "polisher_sequence": Claims({"polisher_sequence": {}}, "wear_error", 2),
    "polisher_spin": Claims({"polisher_spin": {}}, "wear_error", 11),
    "polisher_wear": Claims({
        "polisher_wear": {"e": [0.02, 0.08, 0.1, 0.16], "w_x": [0.5, 0.53, 0.54, 0.56, 0.58], "radius": 2},
        "polisher_wear_load": {"radius": [0.0, 0.05, 0.098], "rtol": 1e-4},
    }, "wear_error", 7),
    "polisher_zone": Claims({"polisher_zone": {}}, "wear_error", 2),
    "rate_parameters": Claims({"rate_parameters": {}}, "", 1),
    "self_starting": Claims({"self_starting": {}}, "flip_speed status", 2),
    "shapiro": Claims({"shapiro": {
        "order": [0, 1], "ac": [0.0, 1.0, 2.5], "detuning": [-0.5, -0.25, 0.0, 0.25, 0.5],
    }}, "status"),
    "stability_maps": Claims({
        "stability_maps": {"mu": 24, "step": 12}, "stability_maps_oscillator": {"a": 8, "w": 8},
        "stability_maps_sticking": {"R": [0.9, 0.999], "step": 12},
        "stability_maps_spring": {"k": [1.5, 1.999], "step": 12},
    }, "amplitude crossing_speed rate_calls steps time status stability_maps_oscillator.clock "
        "stability_maps_oscillator.error stability_maps_oscillator.interval stability_maps_oscillator.pace", 1),
    "relaxation": Claims({"relaxation": {"mu": [0.01, 10**-1.75, 1.0, 1e3, 10**3.5, 1e4]}}, "", 1),
    "stribeck": Claims({
        "stribeck": {"belt": [0.05, 0.5, 1.0, 1.8, 1.85, 2.2]}, "stribeck_unstable": {},
    }, "stribeck.multiplier", 2),
    "stick_slip": Claims({
        "stick_slip": {"method": ["taylor", "dop853"], "belt": [0.02, 0.3], "fall": [0.02, 0.3]},
    }, "interval place speed", 2, tell=False),
    "stiff_lag": Claims({
        "stiff_lag": {"method": ["taylor", "rodas5p"], "mu": [0.1, 10.0], "eps": [1e-9, 1e-5, 1e-1]},
        "stiff_lag_bounce": {"flips": [20, 100, 3000], "e": [0.1, 0.5]},
    }, "angle force interval speed status stiff_lag_bounce.height", 2, tell=False),
    "three_models": Claims({
        "three_models": {"torque": 4}, "three_models_denny": {"mu": 4}, "three_models_viscous": {"mu": 4},
    }, "three_models.swing three_models_denny.amplitude three_models_viscous.multiplier"),
    "timekeeping": Claims({
        f"timekeeping{part}": {
            "sigma": [0.003, 0.01, 0.1], "tau_c": tau_c, "averaging_time": time, "half_swings": half_swings, "seed": 2,
        }
        for part, tau_c, half_swings, time in (
            ("", [0, 1.25, 75, 1800], 15300, 3600.0), ("_buergi", [0, 2.5, 150, 3600], 30600, 3600.0),
            ("_spring", [0, 2.5, 150, 3600], 30600, 900.0),
        )
    }, "truncated rate_error_s_per_day status", 3),
    "torque_ripple": Claims({"torque_ripple": {
        "harmonic": [*range(1, 9), *range(16, 33, 2), 33, 35, 40, 41, 50, 51, 64],
        "depth": [0.0, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5],
    }}, ""),
    "which_average": Claims({"which_average": {}}, ""),
    "verge_unmeshes": Claims({
        "verge_unmeshes": {"e": [0, 0.4, 0.6], "I_c": 2.5e-6 * 10 ** (np.array([0, 4, 8, 9, 12, 14]) / 4)},
    }, "", 2),
    "verge_losses": Claims({
        "verge_losses": {
            "R_v": [0, 3.490658503988659e-5, 3.490658503988659e-4], "flips": 3000, "rtol": 4e-10,
            "I_c": 2.5e-6 * 10 ** (np.array([0, 4, 5, 6, 8, 12, 16]) / 4), "tau": 2, "where": "n * tau > R_v",
        },
        "verge_losses_wheel": {"tau": 2, "flips": 3000, "rtol": 4e-10, "where": "tau > R_c"},
    }, "angle gap interval time status verge_losses_wheel.drag verge_losses_wheel.rubbing "
        "verge_losses_wheel.recoil verge_losses_wheel.speed verge_losses_wheel.wheel", 1),
}
# fmt: on


def thinned(name, cut):
    """A study with some of its values."""
    path = STUDIES / f"{name}.toml"
    read, keys = sweep.study(path, allow_import=True), tomllib.loads(path.read_text(encoding="utf-8"))
    for key, some in cut.items():
        if key in ("rtol", "where"):
            keys[key] = some
        elif key in read.axes or key in read.along:
            table, whole = ("axes", read.axes[key].values) if key in read.axes else ("along", read.along[key])
            keys[table][key] = {"values": list(whole[::some] if isinstance(some, int) else some)}
        else:
            keys["fixed"][key] = some
    return sweep.study(keys, allow_import=True)


def swept(name, cut, folder):
    """Path of the thinned study's result; the borders of the map of laws are refined, as its study says."""
    path = folder / f"{name}.h5"
    if name == "law_map_borders":
        coarse = sweep.run(thinned(name, cut), progress=False)
        assert sweep.refine(coarse, "sensitivity", 0.02, path=path, workers=1).complete
    else:
        sweep.run(thinned(name, cut), path, workers=1, progress=False).close()
    return str(path)


class Told:
    """A script with its results, each sweep that it makes by itself run once, and what is said of all these."""

    def __init__(self, name, claims, folder):
        self.script, self.claims = import_module(name), claims
        self.paths = [swept(file, cut, folder) for file, cut in claims.files.items()]
        self.results = {path: sweep.open_result(path).load() for path in self.paths}
        self.inner, self.run, self.lie = {}, sweep.run, {}
        self.options = {} if claims.tell else {"tell": False}

    def open(self, path, **_):
        """Instead of `sweep.open_result`: the result, or what is to be believed instead."""
        return self.lie.get(str(path), self.results[str(path)]).copy()

    def again(self, study=None, path=None, *, progress=False, workers=None, **keys):
        """Instead of `sweep.run`: in memory the same study is run once."""
        study = sweep.study(**keys) if study is None else study
        if path is not None:
            return self.run(study, path, progress=False)
        text = sweep.to_toml(study)
        if text not in self.inner:
            self.inner[text] = self.run(study, progress=False)
        return self.lie.get("inner", xr.Dataset.copy)(self.inner[text])

    def conclude(self):
        """All statements of the script, by heading; its notes; what draws its figure."""
        return self.script.main.conclude(*self.paths, **self.options)

    @cached_property
    def conclusion(self):
        """The same of the results as they are."""
        return self.conclude()

    def failing(self, **lie):
        """Numbers of the checked statements that fail, all of them where the script ends with one clear line."""
        self.lie = lie
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                groups = self.conclude()[0]
        except (sweep.SweepError, ValueError, IndexError):  # nothing to fit or to interpolate
            return {-1}
        finally:
            self.lie = {}
        return {number for number, s in enumerate(checked(groups)) if s.failed}


def checked(groups):
    """The statements that can fail."""
    return [s for lines in groups.values() for s in lines if s.holds is not None]


@pytest.fixture(scope="module", params=TABLE)
def told(request, tmp_path_factory):
    """A script of the table; the thinned sweeps are run once."""
    found = Told(request.param, TABLE[request.param], tmp_path_factory.mktemp(request.param))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweep, "run", found.again)
        yield found


def test_the_script_draws_its_figure_and_every_statement_holds(told, capsys):
    arguments = [*told.paths, "--all"]
    assert told.script.main.report(arguments, lambda: told.conclusion) == 0
    assert re.search(r"  (yes|no, known)$", printed := capsys.readouterr().out, re.MULTILINE)
    assert [s.what for s in checked(told.conclusion[0]) if s.off is not None and not s.allowed] == []
    picture = Path(told.paths[0]).with_suffix(".png")
    assert printed.rstrip().endswith(f"figure: {picture}")
    assert picture.read_bytes().startswith(b"\x89PNG")


def numbers(ds):
    """Names of outputs that are numbers."""
    return [name for name in ds.data_vars if ds[name].dtype.kind == "f" and name != "error_bound"]


def drift(values):
    """A factor that goes from 0.6 to 1.6 along the first axis, and by less along others."""
    ramps = [
        xr.DataArray(np.linspace(-0.5, 0.5, n), dims=dim) / k for k, (dim, n) in enumerate(values.sizes.items(), 1)
    ]
    return np.exp(sum(ramps))


def rolled(values):
    """The values of other cells."""
    return values.roll({dim: n // 2 for dim, n in values.sizes.items()})


FALSE = (
    lambda values: 1.02 * drift(values) * rolled(values),
    lambda values: drift(values) * values,
    lambda values: 1.02 * values,
    rolled,
)
"""What is done to an output: it is 2 % too large, drifts, and stands in other cells; where that is not enough, as a
study may end with one clear line of it, each of these alone."""


def lies(told, how):
    """("study.output", what is to be believed) for every output that is false so; "inner": the sweeps of the
    script, all of their outputs at once at first."""

    def false(ds, names):
        return ds.assign({name: how(ds[name]).assign_attrs(ds[name].attrs) for name in names})

    inner = sorted({name for ds in told.inner.values() for name in numbers(ds)})
    for names in [inner] if how is FALSE[0] else [[name] for name in inner]:
        yield "inner", {"inner": lambda ds, names=names: false(ds, set(names) & set(ds.data_vars))}
    for path, ds in told.results.items():
        study = Path(path).stem
        silent = {name.removeprefix(f"{study}.") for name in told.claims.silent.split()}
        for name in sorted(set(numbers(ds)) - silent):
            yield f"{study}.{name}", {path: false(ds, [name])}
        if "status" in ds and bool((ds.status != 0).any()) and "status" not in silent and how is FALSE[0]:
            yield f"{study}.status", {path: ds.assign(status=xr.zeros_like(ds.status))}


def test_false_numbers_are_noticed_in_each_output_and_move_the_statements(told, monkeypatch):
    said = [s.what for s in checked(told.conclusion[0])]
    monkeypatch.setattr(sweep, "open_result", told.open)
    found = {output: set() for output, _ in lies(told, FALSE[0])}
    for output, lie in (one for how in FALSE for one in lies(told, how)):
        found[output] |= told.failing(**lie)
        still = [what for number, what in enumerate(said) if number not in set().union(*found.values())]
        unnoticed = [name for name, failed in found.items() if not failed and name != "inner"]
        if not unnoticed and len(still) <= told.claims.still:
            break
    assert any(found.values())
    assert unnoticed == []
    assert len(still) <= told.claims.still, still


def test_a_script_counts_what_holds_and_tells_in_full_what_does_not():
    found = {
        "Part": [
            Statement("period", "1", "1.0", 0.0, True),
            Statement("swing", "2", "3.0", 0.5, False),
            Statement("  at rest", "yes", "no", None, False, True),
            Statement("seconds", "", "5"),
        ],
        "Other": [Statement("  first of its part", "1", "2", 1.0, False)],
    }
    words = "\n".join(summary(found, "theory"))
    assert re.search(r"^Part +1 of 3$", words, re.MULTILINE)
    assert "does not hold: swing; theory: 2; here: 3.0, deviation +5.0e-01" in words
    assert "known not to hold: swing, at rest; theory: yes; here: no" in words
    assert "does not hold: first of its part; theory: 1" in words
    assert "period" not in words


@pytest.mark.parametrize(
    ("bound", "inside", "outside"),
    [
        ("< 1 %", 0.0099, 0.01),
        ("<= 1e-9", 1e-9, 1.1e-9),
        ("> 1/2", 0.51, 0.5),
        (">= .38", 0.38, 0.379),
        ("1/3 to 1/2", 0.5, 0.51),
        ("3 to 5 %", 0.04, 0.06),
        ("0", 0, 1),
    ],
)
def test_a_number_is_held_to_what_its_line_says(bound, inside, outside):
    assert not held("share", inside, bound).failed
    assert held("share", outside, bound).failed
    assert held("share", np.nan, bound).failed
    assert not never("cells", np.zeros(3, bool)).failed
    assert never("cells", np.array([False, True])).failed


SCRIPTS = sorted(p.stem for p in STUDIES.glob("[!_]*.py") if "main = script(" in p.read_text(encoding="utf-8"))


def test_every_script_that_concludes_is_in_the_table():
    assert set(SCRIPTS) == {*TABLE, "fewest_masses", "what_auto_saves", "work_precision"}


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """A result of no study that is here."""
    path = tmp_path_factory.mktemp("other") / "other.h5"
    sweep.run(path=path, kernel="foliot", axes={"mu": [1.0, 2.0], "phi0": [1.0, 2.0]}, fixed={"a": 1.0}).close()
    return str(path)


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_is_used_as_its_head_and_its_study_say(name, other, tmp_path, capsys):
    module = import_module(name)
    assert module.main([]) == 2
    use, *runs = capsys.readouterr().err.splitlines()
    words = use.removeprefix("use: python ").removesuffix(" [--all] [--force]").split()[1:]
    for run, word in zip(runs, [word for word in words if word.endswith(".h5")], strict=True):
        file = re.fullmatch(r"sweep run studies/(\w+)\.toml( --allow-import)?", run)
        assert word.removesuffix(".h5").removesuffix("_fine") == file[1]
        assert bool(file[2]) == (
            ":" in tomllib.loads((STUDIES / f"{file[1]}.toml").read_text(encoding="utf-8"))["kernel"]
        )
    for text in (module.__doc__, (STUDIES / f"{name}.toml").read_text(encoding="utf-8").replace("#", "")):
        used = re.search(rf"python studies/{name}\.py((?:\s+[\w./\\]+\.(?:h5|toml)|\s+\\\n)+)", text)
        assert [Path(word).name for word in used[1].replace("\\", "").split()] == words
    for path in (str(tmp_path / words[0]), other) if words[0].endswith(".h5") else ():
        assert module.main([path] * len(words)) == 2
        assert path in "".join(said := capsys.readouterr().err.splitlines())
        assert len(said) == 1


@pytest.mark.parametrize("path", sorted(STUDIES.glob("*.toml")), ids=lambda path: path.stem)
def test_a_study_file_holds_no_mistake_opens_with_its_question_and_closes_with_its_answer(path):
    """And with how that was checked; its picture has a caption of two to four sentences."""
    study = sweep.study(path, allow_import=True)
    assert path.read_text(encoding="utf-8").startswith("# ")
    assert study.question.endswith("?")
    assert study.title
    if path.with_suffix(".png").exists():
        told, caption = " ".join(what_came_out(path.stem)), path.with_suffix(".md").read_text(encoding="utf-8")
        assert "? " in told
        assert " How it was checked, and its limits: " in told
        assert 2 <= len(re.findall(r"\.(?=\s|$)", caption)) <= 4


def test_the_masses_that_a_model_needs_and_false_counts_and_errors_are_noticed(tmp_path):
    import fewest_masses as study

    study.write_points(tmp_path / "points.csv")
    assert (tmp_path / "points.csv").read_text() == (STUDIES / "fewest_masses.csv").read_text()
    ds = study.prepared(STUDIES / "fewest_masses.toml", 6)
    assert len(study.figure(ds).axes) == 2
    for lie in ({}, {"kept": ds.kept + 1}, {"kept": ds.kept - 1}, {"kept": -ds.kept}, {"error": 5 * ds.error}):
        said = checked(grouped(study.claims(ds.assign(lie))))
        assert any(s.failed for s in said) == bool(lie)


def test_a_method_that_is_silently_wrong_or_gives_fewer_cells_is_noticed():
    import what_auto_saves
    import work_precision

    file = STUDIES / "what_auto_saves_balance.toml"
    found = sweep.work_precision(sweep.study(file), cells=12, tolerances=(1e-3, 1e-12))
    truths = {
        "saves": lambda ds: next(iter(grouped(what_auto_saves.claims([ds])).values())),
        "honest": lambda ds: list(work_precision.honesty("", ds)),
    }
    assert {n: [s.what for s in says(found) if s.failed] for n, says in truths.items()} == {n: [] for n in truths}
    for lie in ({"silent": found.silent + 0.1}, {"error_worst": found.error_worst + 2e-3}):
        wrong = found.assign(lie).assign_attrs(found.attrs)
        assert all(any(s.failed for s in says(wrong)) for says in truths.values())
    fewer = found.assign(ok=found.ok * (found["method"] != "auto"), unsolved=found.unsolved + 0.1)
    assert all(any(s.failed for s in says(fewer.assign_attrs(found.attrs))) for says in truths.values())
    (row,) = what_auto_saves.figure([found]).axes
    assert [text.get_text() for text in row.texts] == ["balance"]


def test_the_point_of_exponent_one_half_is_that_of_20_digits():
    """q - tanh q = 1/alpha and (1 - tanh(q)/q)/tanh(q)^2 = 1/2 at once."""
    import foliot_scaling as study

    _, half = study.prepared(sweep.run(thinned("foliot_scaling", TABLE["foliot_scaling"].files["foliot_scaling"])))
    expected = [1.46299058758010465706, 6.42446119521106945636, 1.39341841440363426389]
    np.testing.assert_allclose([half.alpha, half.aP, half.A], expected, rtol=1e-13)
