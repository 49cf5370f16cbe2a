"""The bar of a notebook, with a notebook's shell stood in for."""

import io
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
