"""Every command of studies/README.md works, in the order in which it stands there."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from kernels.lanes.jit import COMPILED
from sweep.cli import main as sweep_command

ROOT = Path(__file__).parents[2]
COMMANDS = [
    line
    for block in re.findall(r"```sh\n(.*?)```", (ROOT / "studies" / "README.md").read_text(), re.DOTALL)
    for line in block.splitlines()
]

pytestmark = pytest.mark.skipif(not COMPILED, reason="whole studies")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the studies beside it, as the text says; of the largest one every fourth value of its axes."""
    folder = tmp_path_factory.mktemp("hour")
    shutil.copytree(ROOT / "studies", folder / "studies", ignore=shutil.ignore_patterns("__pycache__", "*.png"))
    path = folder / "studies" / "impact_map.toml"
    text = path.read_text(encoding="utf-8")
    for all_values, some in (("num = 481", "num = 121"), ("num = 385", "num = 97")):
        assert all_values in text
        text = text.replace(all_values, some)
    path.write_text(text, encoding="utf-8")
    return folder


def run_here(words, capfd):
    """The command `sweep` in this process: exit status, what it printed, what it complained of."""
    status = sweep_command(words)
    return status, *capfd.readouterr()


def run_script(words, capfd):
    """A script of a study in a process of its own."""
    done = subprocess.run([sys.executable, "-W", "error", *words], capture_output=True, text=True, timeout=600)
    return done.returncode, done.stdout, done.stderr


RUNS = {"sweep": run_here, "python": run_script}


def test_the_text_has_a_study_of_each_kind_of_scene():
    text = "\n".join(COMMANDS)
    for name in ("foliot_scaling", "balance_ringdown", "impact_map", "polisher_extrema", "fula_milling", "own_scene"):
        assert f"sweep run studies/{name}" in text
    for command in ("kernels", "plan", "show", "plot", "fit", "report", "export", "refine", "chart"):
        assert f"sweep {command} " in text


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_works_and_says_nothing_of_faults(command, folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    program, *words = shlex.split(command)
    status, printed, complaints = RUNS[program](words, capfd)
    assert status == 0, printed + complaints
    assert "Traceback" not in complaints
    assert " | NO" not in printed
