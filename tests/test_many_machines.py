"""What the page on many machines says: its code parses, its names are there, and what it runs on this machine runs."""

import ast
import inspect
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import sweep
from sweep.cli import parser

ROOT = Path(__file__).parents[1]
SECTION = (ROOT / "docs" / "many_machines.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", SECTION, re.DOTALL)


def test_its_commands_are_those_of_the_command_line():
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    (ours,) = (shlex.split(line, comments=True)[1:] for line in lines if line.startswith("sweep "))
    found = parser().parse_args(ours)
    assert found.cluster.startswith("tcp://")
    assert (ROOT / found.study).is_file()


def test_its_code_parses_and_passes_what_dask_takes():
    distributed = pytest.importorskip("distributed")
    calls = [node for block in blocks("python") for node in ast.walk(ast.parse(block)) if isinstance(node, ast.Call)]
    named = {call.func.id: call for call in calls if isinstance(call.func, ast.Name)}
    assert {"Client", "SSHCluster", "SLURMCluster"} <= named.keys()
    for name in ("SSHCluster",):
        taken = inspect.signature(getattr(distributed, name)).parameters
        assert {word.arg for word in named[name].keywords} <= taken.keys()


def test_a_client_of_two_processes_here_gives_the_same_result(tmp_path):
    pytest.importorskip("distributed")
    (code,) = (block for block in blocks("python") if "sweep.run" in block)
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    script = tmp_path / "script.py"
    script.write_text(code)
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, env={**os.environ, "PYTHONPATH": path}, capture_output=True,
        text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    study = sweep.study(ROOT / "studies" / "foliot_scaling.toml")
    with sweep.open_result(tmp_path / "foliot_scaling.h5", strict=True) as found:
        here = sweep.run(study, progress=False)
        for name in here.data_vars:
            assert found[name].values.tobytes() == here[name].values.tobytes()
