"""A kernel that does not keep the protocol fails mypy, before anything runs."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")
ROOT = Path(__file__).parents[2]
HEAD = """
from typing import Any

from kernels.interface import Field, Method
from kernels.lanes.jit import jit
from kernels.lanes.wiring import kernel, method, tracing

@jit
def check(p):
    return 0.0

@jit
def solve(p, rtol):
    return (p.a,), 0.0

@jit
def buffered(p, rtol, rows, sums):
    return (p.a,), 0.0

@jit
def bound(p):
    return 1e-9

@jit
def fill(i, columns, row):
    row[0] = columns.a[i]

@jit
def without_rtol(p):
    return (p.a,), 0.0

@jit
def without_status(p: Any, rtol: Any) -> float:
    return 0.0

@jit
def in_a_loop(n):
    return 0.0

A = (Field("a", "m", "length"),)
"""
RIGHT = """
FINE = kernel("fine", doc="", source="", parameters=A, outputs=A, check=check, methods=(
    method("m", "", solve, bound), method("n", "", buffered, 1e-9), tracing("t", "", fill),
))
"""
WRONG = """
method("m", "", without_rtol)
method("m", "", without_status)
method("m", "", bound)
method("m", "", solve, solve)
method("m", "", 1e-9)
method("m", "", solve, "1e-9")
tracing("t", "", bound)
kernel("k", doc="", source="", parameters=A, outputs=A, check=solve, methods=())
kernel("k", doc="", source="", parameters=A, outputs=A, check=check, methods=(solve,))
kernel("k", doc="", source="", parameters=A, outputs=("a",), check=check, methods=())
Method("m", "", 1e-9)
"""


def test_a_kernel_that_keeps_the_protocol_passes_and_each_wrong_line_fails(tmp_path):
    path = tmp_path / "kernel_of_mine.py"
    path.write_text(HEAD + RIGHT + WRONG, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--config-file=", "--follow-imports=silent", "--ignore-missing-imports"]
    environment = {**os.environ, "MYPYPATH": str(ROOT)}
    command += [f"--cache-dir={tmp_path}", path.name]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.stderr == ""
    found = re.findall(r"^kernel_of_mine\.py:(\d+): error", done.stdout, re.MULTILINE)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert [lines[number - 1] for number in sorted({int(n) for n in found})] == WRONG.split("\n")[1:-1], done.stdout
