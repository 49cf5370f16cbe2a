"""Benchmark `roofline.py`: rows of cheap kernels."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SPEED = Path(__file__).parents[2] / "benchmarks" / "speed"


@pytest.mark.parametrize(
    ("kernel", "method", "size", "least", "most"),
    [("foliot", "closed", 9 + 1 + 5, 100, 300), ("drivetrain", "direct", 46, 1e5, 1e6)],
)
def test_a_row_has_the_bits_and_the_bytes_of_its_kernel(kernel, method, size, least, most):
    """A byte of the status, eight of each number; the drivetrain has complex numbers, and the error of each cell."""
    paths = os.pathsep.join([str(SPEED), str(SPEED.parents[1]), os.environ.get("PYTHONPATH", "")])
    settings = os.environ | {"NUMBA_DISABLE_JIT": "0", "PYTHONPATH": paths}
    command = [sys.executable, SPEED / "roofline.py", kernel, "--cells", "6"]
    done = subprocess.run(command, env=settings, check=True, capture_output=True, text=True)
    *_, row = done.stdout.splitlines()
    found, by, operations, stored, took, peak, moved, ratio, *_ = row.split()
    assert (found, by, int(stored)) == (kernel, method, 8 * size + 1)
    assert "other bits" not in row
    assert least < float(operations) < most
    assert float(ratio) == pytest.approx(float(took) / max(float(peak), float(moved)), rel=0.1)
