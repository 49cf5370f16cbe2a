"""What a command line becomes: defaults, what each function is called with, and where it writes."""

from argparse import Namespace
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
import xarray as xr

from sweep import cli
from sweep.command import exploring, files, laws, looking, running, writing
from sweep.system.errors import SweepError

PLAIN = {"command", "by", "study", "result", "other", "folder", "name"}
DEFAULTS = {
    "kernels": {"allow_import": False},
    "studies": {},
    "plan x.toml": {"workers": None, "allow_import": False, "isolate": None, "cell_timeout": None},
    "refine a.h5 --y p q --tolerance 1e-3 -o b.h5": {
        "y": ["p", "q"], "tolerance": 1e-3, "output": Path("b.h5"), "force": False, "most_cells": 1_000_000,
        "workers": None, "allow_import": False, "isolate": None, "cell_timeout": None,
    },
    "chart x.toml": {
        "all": False, "output": None, "force": False, "methods": None, "rtol": None, "cells": 1024, "reference": None,
        "allow_import": False, "isolate": None, "cell_timeout": None,
    },
    "run x.toml": {
        "workers": None, "allow_import": False, "output": None, "force": False, "extend": False, "repair": False,
        "cluster": None, "until": None, "isolate": None, "cell_timeout": None, "retry_failed": False,
        "without_workers": "wait", "notify": None, "log_json": False,
    },
    "show a.h5": {"follow": False},
    "verify a.h5": {},
    "list": {"all": False},
    "diff a.h5 b.h5": {"rtol": 0.0},
    "fit a.h5 --y p --x mu": {
        "y": "p", "x": "mu", "window": None, "confidence": 0.95, "noise": None, "compare": False, "output": None,
        "force": False, "at": [], "unfinished": False,
    },
    "export a.h5 -o b.csv": {
        "output": Path("b.csv"), "force": False, "where": None, "compress": False, "float32": False, "unit": [],
        "unfinished": False,
    },
    "join a.h5 b.h5 -o c.h5": {"output": Path("c.h5"), "force": False, "axis": None, "labels": None},
}  # fmt: skip


def parsed(*words):
    return cli.parser().parse_args([str(word) for word in words])


@pytest.mark.parametrize("line", DEFAULTS)
def test_what_is_not_said_is_the_default(line):
    found = {name: value for name, value in vars(parsed(*line.split())).items() if name not in PLAIN}
    assert found == DEFAULTS[line]


def test_what_is_said_is_taken():
    found = parsed(
        "fit", "a.h5", "--y", "p", "--x", "mu", "--window", 1, 2, "--window", 3, 4, "--at", "a=1", "--at", "b=2", "c=3"
    )
    assert (found.window, found.at) == ([[1.0, 2.0], [3.0, 4.0]], ["a=1", "b=2", "c=3"])
    assert parsed("run", "x.toml", "--no-isolate").isolate is False
    assert parsed("run", "x.toml", "--isolate", "--workers", 3).workers == 3
    assert parsed("chart", "x.toml", "--rtol", "1e-3", "1e-6", "--methods", "a", "b").rtol == [1e-3, 1e-6]
    assert parsed("list").folder == Path()
    for bad in (["list", "a", "b"], ["fit", "a.h5", "--y", "p"], ["run", "x.toml", "--without-workers", "no"], []):
        with pytest.raises(SystemExit):
            parsed(*bad)


def test_cells_of_a_kernel_of_ones_own_are_isolated_unless_it_is_said():
    own, ours = SimpleNamespace(kernel_name="toy:KERNEL"), SimpleNamespace(kernel_name="foliot")
    told = [
        [files.is_isolated(Namespace(isolate=word), study) for study in (own, ours)] for word in (None, True, False)
    ]
    assert told == [[True, False], [True, True], [False, False]]


def test_units_are_names_and_units():
    ds = xr.Dataset({"y": ("x", [1.0, 2.0], {"units": "m"})})
    assert files.in_units_of(ds, ["y=mm"]).y.values.tolist() == [1000.0, 2000.0]
    for text in ("y", "=mm", "y="):
        with pytest.raises(
            SweepError, match=f'^--unit: expected NAME=UNIT, found "{text}"; write e.g. --unit A0=degree$'
        ):
            files.in_units_of(ds, [text])


@pytest.fixture
def result(monkeypatch):
    """Every result is this one, and every target may be written."""
    found = xr.Dataset({"y": ("a", [1.0, 2.0])}, {"a": [1.0, 2.0]})

    @contextmanager
    def opened(*_):
        yield found

    for module in (exploring, laws, looking, writing):
        for name in ("result_of", "opened"):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, opened)
        monkeypatch.setattr(module, "check_target_of", lambda *_: None)
    return found


@pytest.fixture
def calls(monkeypatch):
    """Replaces a function; gathers what it is called with."""
    made = []

    def replace(where, back=None):
        monkeypatch.setattr(where, lambda *given, **keys: (made.append((given, keys)), back)[1])
        return made

    return replace


def run(line):
    arguments = parsed(*line.split())
    return arguments.command(arguments)


@pytest.mark.parametrize(("word", "noise"), [("yes", True), ("no", False), ("uneven", "uneven"), (None, None)])
def test_the_word_on_noise_is_yes_no_or_a_kind(result, calls, monkeypatch, word, noise):
    monkeypatch.setattr("sweep.analysis.scattered.on_lines", lambda part, x: part)
    monkeypatch.setattr("sweep.show.laws.laws_text", str)
    made = calls("sweep.show.laws.laws")
    run("fit a.h5 --y y --x a --window 1 2 --confidence 0.9" + (f" --noise {word}" if word else ""))
    assert made[0][0][1:] == ("y", "a", [[1.0, 2.0]], 0.9, noise)


def test_joined_results_are_called_by_their_files(result, calls, capsys):
    joined = xr.Dataset({"status": ("a", [0])}, {"a": [1.0]})
    made = calls("sweep.explore.join.join", joined)
    calls("sweep.results.statuses.summary_text", "1 cell")
    run("join x/a.h5 y/b.h5 -o c.h5")
    run("join x/a.h5 y/a.h5 -o c.h5 --axis version")
    run("join x/a.h5 y/a.h5 -o c.h5 --labels 1 2 --force")
    joins = [keys for _, keys in made if keys]
    assert [keys["labels"] for keys in joins] == [["a", "b"], ["x/a.h5", "y/a.h5"], ["1", "2"]]
    assert [(keys["axis"], keys["force"]) for keys in joins] == [(None, False), ("version", False), (None, True)]
    assert capsys.readouterr().out.splitlines() == ["c.h5: 1 cell"] * 3


def test_an_export_passes_its_switches_on(result, calls):
    made = calls("sweep.results.export.export")
    run("export a.h5 -o b.nc --compress")
    run("export a.h5 -o b.nc --float32 --force")
    assert [keys for _, keys in made] == [
        {"force": False, "compress": True, "float32": False},
        {"force": True, "compress": False, "float32": True},
    ]


@pytest.mark.parametrize(("same", "code"), [(True, 0), (False, 1)])
def test_a_difference_is_an_exit_status(result, calls, same, code):
    made = calls("sweep.results.diff.diff", SimpleNamespace(same=same))
    assert run("diff a.h5 b.h5 --rtol 1e-3").code == code
    assert made[0][0][2] == 1e-3


@pytest.mark.parametrize(("option", "browser"), [("", True), (" --no-browser", False)])
def test_the_viewer_opens_a_browser_unless_told_not_to(result, calls, option, browser):
    made = calls("sweep.view.server.serve")
    run(f"view a.h5 --port 5007{option}")
    assert made == [((Path("a.h5"), 5007, browser), {})]


def test_the_end_of_a_run_is_told_to_a_command(tmp_path, capsys):
    told = tmp_path / "told"
    arguments = parsed(
        "run", "deep/x.toml", "--notify", f'echo "$SWEEP_OUTPUT|$SWEEP_EXIT|$SWEEP_MEANING|$SWEEP_SUMMARY" > {told}'
    )
    running.notify(arguments, running.Outcome(3, "half"))
    assert told.read_text().startswith("x.h5|3|not complete yet (--until")
    assert told.read_text().endswith("|half\n")
    running.notify(parsed("run", "x.toml", "--notify", "exit 5"), running.Outcome(0, ""))
    assert "--notify: Command 'exit 5' returned non-zero exit status 5" in capsys.readouterr().err


def test_a_file_that_is_written_anew_is_another(tmp_path):
    path = tmp_path / "a"
    assert running._identity(path) is None
    path.write_text("x")
    before = running._identity(path)
    assert running._identity(path) == before
    (tmp_path / "b").write_text("x")
    (tmp_path / "b").replace(path)
    assert running._identity(path) != before


def test_an_unfinished_result_is_taken_only_where_it_is_said(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(files, "check_readable", lambda *_: None)
    monkeypatch.setattr("sweep.results.open.open_result", lambda path: xr.Dataset(attrs=dict.fromkeys(ended, "now")))
    ended = []
    told = pytest.raises(SweepError, match=r"a\.h5: unfinished; continue it with sweep run, or take what there is")
    with told, files.opened(tmp_path / "a.h5", unfinished=False):
        pass
    with files.opened(tmp_path / "a.h5"):
        pass
    assert capsys.readouterr().err == ""
    (tmp_path / "a.h5.unfinished").write_text("")
    with files.opened(tmp_path / "a.h5"):
        pass
    assert "a.h5: unfinished; cells that are not computed yet are NaN and PENDING" in capsys.readouterr().err
    ended.append("end")
    with files.opened(tmp_path / "a.h5", unfinished=False):
        pass
