"""What is told of compiling: while it lasts, in the plan, and not where there is nothing to compile."""

import dataclasses
import io
import time

import numba
import pytest
from toy_studies import build

import sweep
from sweep.cells.timing import work_clock
from sweep.runs import loop

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="plain Python compiles nothing")


def slow_to_compile():
    """The toy's study by a method that numba compiles when it is called first."""
    study = build(axes={"height": [1.0, 2.0]}, method="exact")
    fall = numba.njit(lambda height: height[height > 0.0].sum())

    def method(m):
        return dataclasses.replace(m, solve=lambda *columns: (fall(columns[0]), m.solve(*columns))[1])

    methods = tuple(method(m) if m.name == "exact" else m for m in study.kernel.methods)
    return dataclasses.replace(study, kernel=dataclasses.replace(study.kernel, methods=methods))


def test_compiling_is_told_once_while_it_lasts(monkeypatch):
    monkeypatch.setattr(loop, "SILENT_SECONDS", 0.05)
    log = io.StringIO()
    sweep.run(slow_to_compile(), progress=log)
    assert log.getvalue().count("compiling toy:KERNEL ...\n") == 1
    sweep.run(build(axes={"height": [1.0, 2.0]}), progress=log)
    assert log.getvalue().count("compiling") == 1


def test_what_numba_compiles_is_no_work():
    """Nor what is compiled for it; the clock goes on afterwards."""
    inner = numba.njit(lambda x: x + 1.0)
    outer = numba.njit(lambda x: inner(x) * 2.0)
    began, worked = time.perf_counter(), work_clock()
    assert outer(1.0) == 4.0
    compiled = time.perf_counter() - began
    assert work_clock() - worked < 0.5 * compiled
    worked = work_clock()
    time.sleep(0.01)
    assert work_clock() - worked >= 0.01
