"""Benchmark `roofline.py`: the row of a cheap kernel."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SPEED = Path(__file__).parents[2] / "benchmarks" / "speed"


def test_a_row_has_the_bits_and_the_bytes_of_its_kernel():
    """A byte of the status, eight of each number."""
    paths = os.pathsep.join([str(SPEED), str(SPEED.parents[1]), os.environ.get("PYTHONPATH", "")])
    settings = os.environ | {"NUMBA_DISABLE_JIT": "0", "PYTHONPATH": paths}
    command = [sys.executable, SPEED / "roofline.py", "foliot", "--cells", "6"]
    done = subprocess.run(command, env=settings, check=True, capture_output=True, text=True)
    *_, row = done.stdout.splitlines()
    found, by, operations, stored, took, peak, moved, ratio, *_ = row.split()
    assert (found, by, int(stored)) == ("foliot", "closed", 8 * (9 + 1 + 5) + 1)
    assert "other bits" not in row
    assert 100 < float(operations) < 300
    assert float(ratio) == pytest.approx(float(took) / max(float(peak), float(moved)), rel=0.1)
