"""Benchmark `roofline.py`: operations of formulas known by hand, and rows of cheap kernels."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SPEED = Path(__file__).parents[2] / "benchmarks" / "speed"
BY_HAND = """
import json, sys
import numpy as np
import counted
counted.install()
from kernels.lanes.vectors import exponent, fma, horner, pow2, sqrt, where

def of(action):
    counted.DONE.clear()
    with counted.counting_arrays():
        action(*(counted.Counted(x) for x in (3.0, 2.0)))
    return dict(counted.DONE)

def through_array(x, y):
    column = np.zeros(3)
    column[1] = x
    column[2] = column[1] + column[0]

def loop(x, y):
    while x < 6.5:
        x = x + 1.0

cases = {
    "hypot": lambda x, y: sqrt(x * x + y * y),
    "constants_first": lambda x, y: 1.0 - 2.0 / x * y,
    "numpy_first": lambda x, y: np.float64(2.0) * x,
    "fma": lambda x, y: fma(x, y, 1.0),
    "horner": lambda x, y: horner(x, (1.0, 2.0, 3.0, 4.0)),
    "where": lambda x, y: where(x > y, -x, abs(y)),
    "powers": lambda x, y: pow2(y) * exponent(x),
    "array": through_array,
    "loop": loop,
    "complex": lambda x, y: abs(complex(x, y) * complex(y, x) / (x + 1.0j)),
}
print(json.dumps({name: of(action) for name, action in cases.items()}))
"""
EXPECTED = {
    "hypot": {"plain": 3, "root": 1, "chain": 6},
    "constants_first": {"plain": 2, "division": 1, "chain": 6},
    "numpy_first": {"plain": 1, "chain": 1},
    "fma": {"plain": 1, "chain": 1},
    "horner": {"plain": 3, "chain": 3},
    "where": {"other": 4, "chain": 2},
    "powers": {"plain": 1, "other": 6, "chain": 5},
    "array": {"plain": 1, "chain": 1},
    "complex": {"plain": 17, "division": 4, "root": 1},
    "loop": {"plain": 4, "other": 5, "chain": 4},
}


def python(*words, plain):
    settings = os.environ | {"NUMBA_DISABLE_JIT": "1" if plain else "0"}
    settings["PYTHONPATH"] = os.pathsep.join([str(SPEED), str(SPEED.parents[1]), settings.get("PYTHONPATH", "")])
    return subprocess.run([sys.executable, *words], env=settings, check=True, capture_output=True, text=True).stdout


def test_operations_are_those_of_the_formula():
    assert json.loads(python("-c", BY_HAND, plain=True)) == EXPECTED


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
