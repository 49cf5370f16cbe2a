"""What a newcomer types first works: every command of studies/README.md, every kernel's first study, examples."""

import importlib
import math
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

import sweep
from kernels.catalogue import KERNELS
from kernels.lanes.jit import COMPILED
from sweep.cli import main as sweep_command

STUDIES = Path(__file__).parents[2] / "studies"
BLOCKS = re.findall(r"```sh\n(.*?)```", (STUDIES / "README.md").read_text(encoding="utf-8"), re.DOTALL)
COMMANDS = [line for block in BLOCKS for line in block.splitlines()]
LOCKED = {"theta_lock", "theta_lock_outer"}
"""Given only where a linkage locks."""

pytestmark = pytest.mark.skipif(not COMPILED, reason="whole studies")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the studies beside it, as the text says; of the largest one every fourth value of its axes."""
    folder = tmp_path_factory.mktemp("hour")
    shutil.copytree(STUDIES, folder / "studies", ignore=shutil.ignore_patterns("__pycache__", "*.png"))
    path = folder / "studies" / "impact_map.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("num = 481", "num = 121").replace("num = 385", "num = 97"), encoding="utf-8")
    return folder


def test_the_text_has_a_study_of_each_kind_of_scene_and_the_commands_to_know():
    text = "\n".join(COMMANDS)
    for name in ("foliot_scaling", "balance_ringdown", "impact_map", "polisher_extrema", "fula_milling", "own_scene"):
        assert f"sweep run studies/{name}" in text
    for command in ("kernels", "plan", "show", "plot", "fit", "report", "export", "refine", "chart"):
        assert f"sweep {command} " in text


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_works_and_says_nothing_of_faults(command, folder, monkeypatch, capfd):
    """In the order in which they stand there; a script's `main` in this process, as `test_claims.py` has it."""
    monkeypatch.chdir(folder)
    program, *words = shlex.split(command)
    run = sweep_command if program == "sweep" else importlib.import_module(Path(words.pop(0)).stem).main
    status, (printed, complaints) = run(words), capfd.readouterr()
    assert status == 0, printed + complaints
    assert "Traceback" not in complaints
    assert not re.search("  NO$", printed, re.MULTILINE)


@pytest.mark.parametrize("name", sorted(KERNELS))
def test_the_study_to_begin_with_runs_and_varies_what_grows_about_the_example(name, tmp_path, capsys):
    assert sweep_command(["kernels", name, "--study", str(tmp_path / "study.toml")]) == 0
    study = sweep.study(tmp_path / "study.toml")
    assert study.question
    ds = sweep.run(study, progress=False, workers=1)
    assert bool((ds.status == 0).any())
    valued = ds.status < 64
    assert all(np.isfinite(ds[output.name].where(valued)).any() for output in study.asked if output.name not in LOCKED)
    for values in (*study.along.values(), *(axis.values for axis in study.axes.values())):
        assert (np.diff(values) > 0).all()
    for axis in set(study.axes) & set(study.kernel.example):
        assert study.axes[axis].values.min() <= study.kernel.example[axis] <= study.axes[axis].values.max()


def swing(b, d, f, e):
    """Half of what the arm swings, by the triangle of coupler, arm and motor at both dead points, in textbook form."""
    angles = [math.acos((b**2 + d**2 - side**2) / (2 * b * d)) for side in (f + e, f - e)]
    return (angles[0] - angles[1]) / 2


def test_the_machine_found_swings_as_wanted_and_none_nearby_is_less_distorted():
    design = importlib.import_module("inverse_design")  # compiles a kernel where it is read: not by every worker
    f, e, distorted = design.best()
    assert swing(design.MOTOR, design.ARM, f, e) == pytest.approx(math.radians(15), rel=1e-10)
    assert distorted <= min(design.distortion(f) for f in np.linspace(0.30, 0.70, 41)) * (1 + 1e-9)
    assert math.isnan(design.crank(0.30, math.radians(80)))
    assert design.distortion(0.30, math.radians(80)) == math.inf


def test_a_clock_is_known_from_its_periods_and_a_power_law_has_the_exponent_of_our_own_fit():
    pytest.importorskip("lmfit")
    import fit_a_model as model

    found = model.fitted(model.measured())
    for name, value in model.TRUE.items():
        assert abs(found.params[name].value - value) < 4 * found.params[name].stderr < 0.01 * value
    assert found.redchi == pytest.approx(model.NOISE**2, rel=0.8)
    period = sweep.run(**model.KEYS, axes={"mu": np.geomspace(1e4, 1e6, 21)}, fixed=model.TRUE).period
    law = float(model.power_law(period, 1e3).curvefit_coefficients.sel(param="p"))
    assert law == pytest.approx(float(sweep.fit_exponent(period, "mu").exponent), abs=2e-4)
    assert law == pytest.approx(-1 / 3, abs=2e-3)
