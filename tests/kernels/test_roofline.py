"""Benchmark `roofline.py`: operations of formulas known by hand, and rows of cheap kernels."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SPEED = Path(__file__).parents[2] / "benchmarks" / "speed"


def python(*words, plain):
    settings = os.environ | {"NUMBA_DISABLE_JIT": "1" if plain else "0"}
    settings["PYTHONPATH"] = os.pathsep.join([str(SPEED), str(SPEED.parents[1]), settings.get("PYTHONPATH", "")])
    return subprocess.run([sys.executable, *words], env=settings, check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize(
    ("kernel", "method", "size", "least", "most"),
    [("foliot", "closed", 9 + 1 + 5, 100, 300), ("drivetrain", "direct", 46, 1e5, 1e6)],
)
def test_a_row_has_the_bits_and_the_bytes_of_its_kernel(kernel, method, size, least, most):
    """A byte of the status, eight of each number; the drivetrain has complex numbers, and the error of each cell."""
    *_, row = python(str(SPEED / "roofline.py"), kernel, "--cells", "6", plain=False).splitlines()
    found, by, operations, stored, took, peak, moved, ratio, *_ = row.split()
    assert (found, by, int(stored)) == (kernel, method, 8 * size + 1)
    assert "other bits" not in row
    assert least < float(operations) < most
    assert float(ratio) == pytest.approx(float(took) / max(float(peak), float(moved)), rel=0.1)
