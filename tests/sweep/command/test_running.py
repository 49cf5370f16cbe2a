"""The command `run` without a run: what it calls, what it says of the result, and with which status it ends."""

import signal
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from sweep import cli
from sweep.command import files, running
from sweep.command.outcome import Outcome
from sweep.system.errors import SweepError

STUDY = SimpleNamespace(kernel_name="foliot")


def parsed(line):
    return cli.parser().parse_args(line.split())


@pytest.fixture
def ends(monkeypatch, tmp_path):
    """Runs the command on a run that ends in some way; what it says, and what was asked for."""
    output = tmp_path / "x.h5"

    def run(whole, begun=True, failed=0, before=None, line="run x.toml", writes=True):
        asked = []
        if before is not None:
            output.write_text(before)

        def complete(study, path, **options):
            asked.append((study, path, options))
            if writes:
                output.with_name("new").write_text("new")
                output.with_name("new").replace(output)
            return whole

        @contextmanager
        def after(study, path, state):
            asked.append(state)
            yield {"FAILED": failed}

        monkeypatch.setattr("sweep.runs.run.complete", complete)
        monkeypatch.setattr("sweep.runs.run.is_begun", lambda path: begun)
        monkeypatch.setattr("sweep.results.statuses.summary_text", lambda found: "4 cells")
        monkeypatch.setattr("sweep.results.statuses.tally", lambda found: found)
        monkeypatch.setattr(running, "_after", after)
        return running._computed(parsed(line), STUDY, output), asked, output

    return run


def test_a_run_is_asked_for_what_the_command_says(ends):
    _, asked, output = ends(True, line="run x.toml --workers 3 --extend --until 07:00 --cell-timeout 5s")
    expected = {"workers": 3, "cluster": None, "without_workers": "wait", "force": False, "extend": True}
    expected |= {"until": "07:00", "isolate": False, "cell_timeout": "5s", "retry_failed": False, "repair": False}
    assert asked == [(STUDY, output, expected), ""]


@pytest.mark.parametrize(
    ("keys", "code", "text"),
    [
        ({"whole": True}, 0, "4 cells"),
        ({"whole": True, "before": "old"}, 0, "4 cells"),
        ({"whole": True, "before": "old", "writes": False}, 0, "done before; 4 cells"),
        ({"whole": True, "failed": 1}, 4, "4 cells"),
        ({"whole": False}, 3, "unfinished; 4 cells"),
        ({"whole": False, "failed": 2}, 3, "unfinished; 4 cells"),
        ({"whole": False, "begun": False}, 3, "unfinished; no cell is computed yet"),
    ],
)
def test_how_a_run_ended_is_its_status_and_what_is_said(ends, capsys, keys, code, text):
    found, asked, output = ends(**keys)
    assert found == Outcome(code, f"{output}: {text}")
    assert capsys.readouterr().out == f"{output}: {text}\n"
    assert asked[1:] == ([] if keys.get("begun") is False else [text.removesuffix("4 cells")])


def test_a_result_is_opened_by_what_became_of_it(monkeypatch):
    monkeypatch.setattr("sweep.results.stored.Stored", lambda *words: ("stored", *words))
    monkeypatch.setattr("sweep.results.open.open_result", lambda path: ("result", path))
    monkeypatch.setattr("sweep.results.open.open_unfinished", lambda path: ("unfinished", path))
    found = [running._after("study", "x.h5", state) for state in ("", "done before; ", "unfinished; ")]
    assert found == [("stored", "x.h5", "study"), ("result", "x.h5"), ("unfinished", "x.h5")]


def test_a_run_writes_beside_the_caller_unless_it_is_told():
    assert running._output(parsed("run deep/x.toml")) == Path("x.h5")
    assert running._output(parsed("run deep/x.toml -o y/z.h5")) == Path("y/z.h5")


@pytest.fixture
def logged(monkeypatch):
    """What is logged, and where; a study that is not read, and an output that is not looked at."""
    found = []

    @contextmanager
    def logging_to(path, as_json):
        found.append((path, as_json))
        yield

    monkeypatch.setattr("sweep.system.log.log", lambda *words, **keys: found.append((words, keys)))
    monkeypatch.setattr("sweep.system.log.logging_to", logging_to)
    monkeypatch.setattr("sweep.system.log.log_path", lambda output: output.with_name("the log"))
    monkeypatch.setattr(running, "study_from", lambda arguments: STUDY)
    monkeypatch.setattr(running, "check_readable", lambda path: found.append(path))
    return found


def test_the_end_of_a_run_is_logged(logged, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running, "_computed", lambda *words: Outcome(3, "half"))
    assert running._run(parsed("run x.toml --log-json")) == Outcome(3, "half")
    assert logged == [Path("x.h5"), (Path("the log"), True), (("ended with 3: half", "end"), {"exit": 3})]
    assert running._run(parsed("run x.toml -o none/x.h5")) == Outcome(3, "half")
    assert logged[4] == (None, False)


@pytest.mark.parametrize(
    ("fault", "code", "text"), [(SweepError("so"), 2, "so"), (KeyboardInterrupt(), 130, "stopped")]
)
def test_a_fault_of_a_run_is_logged_and_goes_on(logged, monkeypatch, tmp_path, fault, code, text):
    def computed(*words):
        raise fault

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running, "_computed", computed)
    with pytest.raises(type(fault)):
        running._run(parsed("run x.toml"))
    assert logged[-1] == ((f"ended with {code}: {text}", "end"), {"exit": code})


@pytest.mark.parametrize("before", [signal.SIG_DFL, signal.default_int_handler])
def test_signals_that_change_the_number_of_cores_end_no_run_before_it_computes(logged, monkeypatch, tmp_path, before):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running, "_computed", lambda *words: Outcome(0, ""))
    handlers = {number: signal.signal(number, before) for number in (signal.SIGUSR1, signal.SIGUSR2)}
    try:
        running._run(parsed("run x.toml"))
        after = signal.SIG_IGN if before is signal.SIG_DFL else before
        assert [signal.getsignal(number) for number in handlers] == [after] * 2
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def test_a_command_that_takes_too_long_is_told(monkeypatch, capsys):
    monkeypatch.setattr(running, "NOTIFY_SECONDS", 0.01)
    arguments = parsed("run x.toml")
    arguments.notify = "exec sleep 2"
    running.notify(arguments, Outcome(99, ""))
    assert "--notify: Command 'exec sleep 2' timed out" in capsys.readouterr().err


def test_a_study_in_place_of_a_result_is_told_how_to_become_one():
    with (
        pytest.raises(SweepError, match=r"^x\.toml is a study, not a result; compute it with: sweep run x\.toml$"),
        files.opened(Path("x.toml")),
    ):
        pass


@pytest.mark.parametrize("name", ["x.h5", "x.zarr"])
def test_a_result_that_is_not_there_is_told_as_such(tmp_path, name):
    with pytest.raises(SweepError, match=r"no such file, and no sweep that writes it$"), files.opened(tmp_path / name):
        pass


@pytest.mark.parametrize(("whole", "reads", "said"), [(False, True, None), (True, True, None), (True, False, "x.h5")])
def test_a_forged_result_is_told_before_it_is_opened(monkeypatch, whole, reads, said):
    done = []
    monkeypatch.setattr("sweep.store.probe.intact", lambda path: whole)
    monkeypatch.setattr("sweep.store.probe.probing", lambda path: lambda: (done.append("read"), reads)[1])
    monkeypatch.setattr(files, "import_module", done.append)
    if said:
        with pytest.raises(SweepError, match=r"^x\.h5: not the result of a sweep, or damaged"):
            files.check_readable(Path(said), "json")
    else:
        files.check_readable(Path("x.h5"), "json")
    assert done == (["json", "read"] if whole else [])


@pytest.mark.parametrize(
    ("line", "target", "kind", "expected"),
    [
        ("export a.h5 -o B.CSV", "B.CSV", None, (".csv", False, ["a.h5"])),
        ("export a.h5 -o b.csv --force", "b.csv", "laws", ("laws", True, ["a.h5"])),
        ("chart x.toml", "x.png", None, (".png", False, ["x.toml"])),
    ],
)
def test_a_target_is_checked_against_what_is_read(monkeypatch, line, target, kind, expected):
    asked = []
    monkeypatch.setattr(
        "sweep.system.overwriting.check_target",
        lambda path, kind, force, read: asked.append((path, (kind, force, list(map(str, read))))),
    )
    files.check_target_of(parsed(line), Path(target), kind)
    assert asked == [(Path(target), expected)]


def test_what_is_said_has_nothing_that_moves_the_terminal(capsys):
    files.say("a\x1b[2Jb")
    assert "\x1b" not in capsys.readouterr().out


def test_what_a_command_says_nothing_of_may_be_unfinished(monkeypatch):
    monkeypatch.setattr(files, "opened", lambda *words: words)
    found = [files.result_of(parsed(line)) for line in ("show a.h5", "export a.h5 -o b.csv")]
    assert found == [(Path("a.h5"), True), (Path("a.h5"), False)]
    assert files.result_of(parsed("export a.h5 -o b.csv --unfinished")) == (Path("a.h5"), True)
