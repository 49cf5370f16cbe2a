"""Every command of studies/README.md works, in the order in which it stands there."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from kernels.lanes.jit import COMPILED

ROOT = Path(__file__).parents[2]
COMMANDS = [
    line
    for block in re.findall(r"```sh\n(.*?)```", (ROOT / "studies" / "README.md").read_text(), re.DOTALL)
    for line in block.splitlines()
]

pytestmark = pytest.mark.skipif(not COMPILED, reason="whole studies")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the studies beside it, as the text says."""
    folder = tmp_path_factory.mktemp("hour")
    (folder / "studies").symlink_to(ROOT / "studies")
    return folder


def test_the_text_has_a_study_of_each_kind_of_scene():
    text = "\n".join(COMMANDS)
    for name in ("foliot_scaling", "balance_ringdown", "impact_map", "polisher_extrema", "fula_milling", "own_scene"):
        assert f"sweep run studies/{name}" in text
    for command in ("kernels", "plan", "show", "plot", "fit", "report", "export", "refine", "chart"):
        assert f"sweep {command} " in text


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_works_and_says_nothing_of_faults(command, folder):
    words = shlex.split(command)
    program = {"sweep": ["-m", "sweep.cli"], "python": []}[words[0]]
    environment = {**os.environ, "PYTHONWARNINGS": "error"}
    done = subprocess.run(
        [sys.executable, *program, *words[1:]], cwd=folder, env=environment, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert " | NO" not in done.stdout
