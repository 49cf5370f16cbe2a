"""A result of three axes, with cells that are refused."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import sweep

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("view") / "map.h5"
    study = sweep.study(
        kernel="foliot",
        outputs=["period", "amplitude"],
        axes={
            "mu": {"spacing": "log", "start": 1e-2, "stop": 1e2, "num": 41},
            "R": {"spacing": "linear", "start": 0.0, "stop": 2.0, "num": 21},
            "a": {"values": [0.5, 1.0, 2.0]},
        },
        fixed={"phi0": 1.0},
        title="A map of three axes",
    )
    sweep.run(study, path, progress=False).close()
    return path


@pytest.fixture
def dataset(result):
    with sweep.open_result(result) as found:
        yield found


@pytest.fixture(scope="module")
def address(result):
    """Where the page of the result is served."""
    command = [sys.executable, "-m", "sweep", "view", str(result), "--no-browser"]
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path}) as server:
        yield re.match(r"(http://127\.0\.0\.1:\d+/) ", server.stdout.readline())[1]
        server.send_signal(2)
        assert server.wait(20) == 0
