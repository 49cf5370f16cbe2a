"""The bar of a notebook, with a notebook's shell stood in for."""

import io
import os
import sys
from types import SimpleNamespace

import pytest
from toy_studies import build

import sweep
from sweep.system import bar
from sweep.system.progress import Progress

pytest.importorskip("tqdm")


class ZMQInteractiveShell:
    """What IPython calls the shell of a notebook."""


def in_a_notebook(monkeypatch):
    """What a notebook shows from now on; not as a fixture, for pytest puts its own stderr in place before the call."""
    shown = io.StringIO()
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=ZMQInteractiveShell, version_info=(9,)))
    monkeypatch.setattr(sys, "stderr", shown)
    return shown


def test_there_is_no_bar_elsewhere():
    assert not bar.in_notebook()
    assert bar.notebook_bar(sys.stderr, "sweep", 10, 0) is None


def test_a_notebook_shows_a_bar_of_cells(monkeypatch):
    notebook = in_a_notebook(monkeypatch)
    import tqdm
    import tqdm.auto

    monkeypatch.setattr(tqdm.auto, "tqdm", tqdm.tqdm)  # without widgets
    now = [0.0]
    progress = Progress(100, sys.stderr, clock=lambda: now[0])
    for second in range(1, 5):
        now[0] = 2.0 * second
        progress.add(20)
    progress.note("a word")
    progress.end()
    progress.stop()
    told = notebook.getvalue()
    assert "80 %|" in told
    assert "80/100 cells" in told
    assert "sweep: a word" in told
    assert progress._bar._bar.n == 80


def test_a_stream_of_ones_own_gets_lines(monkeypatch):
    in_a_notebook(monkeypatch)
    assert bar.notebook_bar(io.StringIO(), "sweep", 10, 0) is None


def test_a_short_run_says_nothing(monkeypatch):
    notebook = in_a_notebook(monkeypatch)
    sweep.run(build(axes={"height": [1.0]}))
    assert notebook.getvalue() == ""


SLOW_RUN = """
import os, sweep
os.environ["MPLBACKEND"] = "agg"
keys = {"kernel": "slow:SLOW", "axes": {"height": [1.0 + k for k in range(3000)]}, "outputs": ["fall_time"]}
ds = sweep.run(keys, workers=1, allow_import=True)
"""


def test_a_real_notebook_shows_one_line_that_moves_and_a_table(monkeypatch):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path for path in sys.path if path))
    cells = [nbformat.v4.new_code_cell(source) for source in (SLOW_RUN, "sweep.study(**keys, allow_import=True)")]
    nbclient.NotebookClient(nbformat.v4.new_notebook(cells=cells), timeout=120).execute()
    told = "".join(output.get("text", "") for output in cells[0].outputs)
    states = [state for state in told.split("\r") if "%|" in state]
    assert len(states) > 2
    assert "slow over height" in states[1]
    assert "3,000/3,000 cells" in states[-1]
    (shown,) = cells[1].outputs
    assert "<table" in shown["data"]["text/html"]
