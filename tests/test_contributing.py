"""CONTRIBUTING.md works as it stands: its pendulum is added to a copy of the tree, and its commands are run."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"<!-- (file|insert|run)(?:: (\S+)(?: after ([^\n]+?))?)? -->\n```\w+\n(.*?)```", re.DOTALL)
TESTS = ("helpers", "conftest.py", "quick.txt", "long.txt")
COPIED = ("kernels", "sweep", *(f"tests/{name}" for name in TESTS), "pyproject.toml")


def copied_to(folder):
    for name in COPIED:
        source, target = ROOT / name, folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, target)


def follow(folder):
    """Does what the page says; returns its commands."""
    commands = ""
    for kind, name, line, text in BLOCK.findall(PAGE):
        if kind == "run":
            commands += text
        elif kind == "insert":
            path = folder / name
            before, after, rest = path.read_text(encoding="utf-8").partition(line + "\n")
            assert after, f"{name} has no line {line}"
            path.write_text(before + after + text + rest, encoding="utf-8")
        else:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
    return commands


def ran(commands, folder):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    env = {**os.environ, "PATH": path, "PYTHONPATH": str(folder)}
    done = subprocess.run(["bash", "-e", "-c", commands], cwd=folder, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_pendulum_of_the_page_passes_its_tests_and_is_swept(tmp_path):
    copied_to(tmp_path)
    told = ran(follow(tmp_path), tmp_path)
    assert "pendulum: period of a pendulum of any amplitude" in told
    assert "2 passed" in told
    with h5py.File(tmp_path / "pendulum.h5") as file:
        amplitude, period = file["amplitude"][()], file["period"][()]
    series = 1 + amplitude[:20] ** 2 / 16 + 11 * amplitude[:20] ** 4 / 3072
    np.testing.assert_allclose(period[:20], 2 * np.pi * np.sqrt(0.7 / 9.80665) * series, rtol=1e-12)
    assert (np.diff(period) > 0).sum() == 60


def test_each_helper_of_the_tests_has_a_line():
    named = re.findall(r"^\| `(\w+\.py)` \|", PAGE, re.MULTILINE)
    assert named == sorted(path.name for path in (ROOT / "tests" / "helpers").glob("*.py"))


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "benchmarks/README.md"])
def test_what_a_page_names_is_there(page):
    """Paths in back-quotes, and the targets of links."""
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    quoted = re.findall(r"`((?:kernels|sweep|studies|tests|benchmarks|docs)/[\w./]*)`", text)
    linked = re.findall(r"\]\((?!http)([^)#]+)\)", text)
    made = {name for _, name, _, _ in BLOCK.findall(PAGE)}
    missing = [name for name in quoted if name not in made and not (ROOT / name).exists()]
    assert missing + [name for name in linked if not (ROOT / page).parent.joinpath(name).exists()] == []
