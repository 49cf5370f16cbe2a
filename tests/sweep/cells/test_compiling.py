"""What is told of compiling: while it lasts, in the plan, and not where there is nothing to compile."""

import dataclasses
import io
import json
import time

import numba
import pytest
import toy
from toy_studies import build

import sweep
from sweep.cells import compiling
from sweep.cells.compiling import work_clock


class Dispatcher:
    """A function as numba makes them: compiled, by sleeping, when it is called first."""

    def __init__(self, function, seconds):
        self.function, self.seconds, self.signatures = function, seconds, []

    def __call__(self, *columns):
        if not self.signatures:
            time.sleep(self.seconds)
            self.signatures.append("float64")
        self.function(*columns)


@pytest.fixture
def table(tmp_path, monkeypatch):
    """The file of what compiling took."""
    monkeypatch.setattr(compiling, "SILENT_SECONDS", 0.05)
    monkeypatch.setattr(compiling, "machine_code_folder", lambda: tmp_path / "code")
    return tmp_path / compiling.TABLE


def slow_to_compile(seconds=0.2):
    """The toy's study with one method that takes so long to compile."""
    study = build(axes={"height": [1.0, 2.0]}, method="exact")
    methods = [
        dataclasses.replace(m, solve=Dispatcher(m.solve, seconds)) if m.name == "exact" else m
        for m in study.kernel.methods
    ]
    return dataclasses.replace(study, kernel=dataclasses.replace(toy.KERNEL, methods=tuple(methods)))


def test_compiling_is_told_with_the_name_of_the_method_while_it_lasts(table):
    log = io.StringIO()
    sweep.run(slow_to_compile(), progress=log)
    assert log.getvalue().count("compiling toy:KERNEL.exact ...\n") == 1
    assert json.loads(table.read_text())["toy:KERNEL.exact"] == pytest.approx(0.2, abs=0.15)
    sweep.run(slow_to_compile(), progress=log)
    assert "compiling toy:KERNEL.exact ... (about 0.2 s when last done)" in log.getvalue()


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="plain Python compiles nothing")
def test_what_numba_compiles_is_no_work():
    """Nor what is compiled for it; the clock goes on afterwards."""
    inner = numba.njit(lambda x: x + 1.0)
    outer = numba.njit(lambda x: inner(x) * 2.0)
    began, worked = time.perf_counter(), work_clock()
    assert outer(1.0) == 4.0
    compiled = time.perf_counter() - began
    assert work_clock() - worked < 0.2 * compiled
    worked = work_clock()
    time.sleep(0.01)
    assert work_clock() - worked >= 0.01
