"""A run ends when it is told to, whatever its kernel does; what became of it is in its exit status and its log."""

import json
import os
import re
import signal
import time
from datetime import datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest
from running import quiet, tall, wait_for
from toy_studies import STONES

import sweep
from sweep.cli import parser
from sweep.errors import EXIT_CODES, SweepError
from sweep.file.store import unfinished_of
from sweep.results.statuses import account
from sweep.runs.loop import deadline, passed
from sweep.runs.progress import LOG, log, log_path, logging_to, read_lines
from sweep.show.text import reasons

SECONDS = 10.0
"""What a run may take to end: two seconds, and eight for a machine with much to do to notice."""


def solved(output):
    """How many cells are kept; 0 before the run has begun."""
    try:
        with sweep.open_result(output) as found:
            return account(found).by_kind["ok"]
    except SweepError:
        return 0


# signals


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("options", [["--cell-timeout", "10 min"], ["--no-isolate"]])
def test_a_kernel_that_never_ends_does_not_keep_a_run_from_it(begun, number, options):
    process, output = begun("bad:STUCK", 400, *options)
    wait_for(lambda: solved(output) >= 300, process)
    kept, at = solved(output), time.monotonic()
    process.send_signal(number)
    _, told = process.communicate(timeout=60)
    assert time.monotonic() - at < SECONDS
    assert (process.returncode, "Traceback" in told, "continue" in told) == (128 + number, False, True)
    assert solved(output) >= kept
    assert f"ended with {128 + number}" in list(read_lines(log_path(output).read_text()))[-1]["text"]


def test_a_run_whose_kernel_is_being_imported_ends_in_its_own_words(begun, tmp_path):
    """Behind the import, which would fail in words of a library's own; where it fails for a second signal, too."""
    for signals in (1, 2):
        text = "import os, signal\n" + signals * "os.kill(os.getpid(), signal.SIGTERM)\n"
        (tmp_path / "early.py").write_text(f"{text}from bad import SLOW as KERNEL\n")
        process, _ = begun("early:KERNEL", 10)
        assert (process.communicate(timeout=60)[1], process.returncode) == ("stopped\n", 143)


def test_of_a_run_that_is_killed_no_process_is_left(begun):
    """Not even one in a kernel that never lets Python run."""
    psutil = pytest.importorskip("psutil")
    process, output = begun("bad:HOGGING", 60, "--cell-timeout", "10 min")
    wait_for(lambda: log_path(output).exists() and "begins" in log_path(output).read_text(), process)
    wait_for(lambda: len(psutil.Process(process.pid).children(recursive=True)) >= 3, process)
    time.sleep(3.0)  # they come to the kernel meanwhile
    below = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    process.wait()
    assert psutil.wait_procs(below, timeout=20)[1] == []


def test_a_machine_that_sleeps_costs_no_cell(begun):
    """All processes of the run are stopped for longer than a cell may take, some of them inside cells."""
    process, output = begun("bad:SLOW", 100, "--cell-timeout", "3 s")
    wait_for(lambda: solved(output) >= 20, process)
    os.killpg(process.pid, signal.SIGSTOP)
    time.sleep(5.0)
    os.killpg(process.pid, signal.SIGCONT)
    process.communicate(timeout=120)
    assert (process.returncode, solved(output)) == (0, 100)


# the time that is up


def test_a_time_of_day_is_the_next_one_and_a_date_that_moment():
    now = datetime(2026, 11, 21, 7).astimezone()
    for text, hours in (("07:00", 24), (" 23:59 ", 17 - 1 / 60), ("06:59", 24 - 1 / 60), ("2026-11-20 07:00", -24)):
        assert deadline(text, now) == now + timedelta(hours=hours)


@pytest.mark.parametrize("text", ["7 o'clock", "", "25:00", 7, b"07:00"])
def test_what_is_no_time_is_told(text, tmp_path):
    with pytest.raises(SweepError, match="until"):
        quiet(tall(3), tmp_path / "out.h5", until=text)


def test_until_goes_by_the_clock_on_the_wall_however_it_jumps(monkeypatch):
    """Half an hour before its time a laptop is shut for an hour: the run ends when it wakes. Set back, it goes on."""
    until = datetime(2027, 1, 31, 7, 0).astimezone()
    for at, over in (((6, 30), False), ((7, 30), True), ((6, 45), False), ((7, 0), True)):
        clock = SimpleNamespace(now=lambda at=at: datetime(2027, 1, 31, *at))
        monkeypatch.setattr("sweep.runs.loop.datetime", clock)
        assert passed(until) is over


def test_it_ends_at_its_time_although_kernels_never_do(begun):
    at = datetime.now() + timedelta(seconds=8)
    process, _ = begun("bad:ENDLESS", 100, "--cell-timeout", "10 min", "--until", at.isoformat())
    process.communicate(timeout=60)
    assert datetime.now() - at < timedelta(seconds=SECONDS)
    assert process.returncode == 3


# an output that is taken away


def replace(path):
    path.with_name("copy").write_bytes(path.read_bytes())
    path.with_name("copy").replace(path)


AWAY = {
    "renamed": lambda path: path.rename(path.with_name("other")),
    "folder moved": lambda path: path.parent.rename(path.parent.with_name("moved")),
    "replaced": replace,
    "removed": lambda path: path.unlink(),
    "truncated": lambda path: os.truncate(path, path.stat().st_size // 2),
    "overwritten": lambda path: path.write_bytes(bytes(path.stat().st_size)),
}


@pytest.mark.parametrize("deed", AWAY)
def test_an_output_that_is_moved_or_spoilt_ends_the_run_within_seconds_and_keeps_what_is_left(begun, tmp_path, deed):
    (tmp_path / "here").mkdir()
    process, _ = begun("slow:SLOW", 20000, "-o", "here/stones.h5", "--no-isolate", "--workers", "1")
    output = tmp_path / "here" / "stones.h5"
    wait_for(lambda: solved(output) >= 100, process)
    kept, at = solved(output), time.monotonic()
    AWAY[deed](unfinished_of(output))
    _, said = process.communicate(timeout=60)
    assert time.monotonic() - at < SECONDS
    assert (process.returncode, str(unfinished_of(output)) in said) == (3, True)
    moved = {"renamed": tmp_path / "here" / "other", "folder moved": unfinished_of(tmp_path / "moved" / "stones.h5")}
    if deed in moved:
        moved[deed].rename(unfinished_of(tmp_path / "back.h5"))
        assert solved(tmp_path / "back.h5") >= kept


# exit statuses and the log


@pytest.fixture
def command(tmp_path, monkeypatch, call):
    """Runs a command in a folder with two studies: its exit status, and what it said."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.toml").write_text(STONES.format(kernel="toy:KERNEL", count=5))
    (tmp_path / "bad.toml").write_text(STONES.format(kernel="bad:RAISING", count=20))

    def command(*words):
        code, printed, complained = call(*words)
        return code, printed + complained

    return command


OWN = ("--allow-import", "--no-isolate")


def test_the_exit_status_says_what_became_of_the_run(command):
    assert command("run", "good.toml", "--until", "2001-01-01", *OWN)[0] == 3
    assert command("run", "good.toml", *OWN)[0] == 0
    assert command("run", "bad.toml", *OWN)[0] == command("run", "bad.toml", *OWN)[0] == 4
    assert command("run", "none.toml", *OWN)[0] == 2
    told = parser().format_help()
    page = (Path(__file__).parents[3] / "docs" / "exit_codes.md").read_text()
    for code, meaning in EXIT_CODES.items():
        assert re.search(rf"^ *{code}  {re.escape(meaning)}$", told, re.MULTILINE)
        assert f"| {code} | {meaning} |" in page


def test_an_unfinished_result_is_reported_exported_and_fitted_only_when_that_is_meant(command):
    assert command("run", "good.toml", *OWN, "--until", "2001-01-01")[0] == 3
    export = ("export", "good.h5", "-o", "good.csv")
    for words in (export, ("report", "good.h5"), ("fit", "good.h5", "--y", "fall_time", "--x", "height")):
        code, told = command(*words)
        assert (code, "--unfinished" in told) == (2, True)
    assert command(*export, "--unfinished")[0] == 0


def test_show_names_the_cells_that_failed_and_why(command, tmp_path):
    command("run", "bad.toml", *OWN)
    assert "cell 10  height=11  ZeroDivisionError: eleven" in command("show", "bad.h5")[1]
    assert reasons(tmp_path / "bad.h5") == {10: "ZeroDivisionError: eleven"}
    log_path(tmp_path / "bad.h5").unlink()
    assert "cell 10  height=11 " in command("show", "bad.h5")[1]


@pytest.mark.parametrize("options", [[], ["--log-json"]])
def test_the_log_tells_of_the_run_from_its_beginning_to_its_end(command, tmp_path, options):
    command("run", "bad.toml", *OWN, *options)
    text = log_path(tmp_path / "bad.h5").read_text()
    lines = [line["text"] for line in read_lines(text)]
    assert all(word in lines[0] for word in ("begins: bad.h5", "bad:RAISING", "numba", "foliot", "process"))
    assert lines[-1].startswith("ended with 4: bad.h5: 20 cells: 19 ok")
    assert [line for line in lines if "FAILED (" in line] == ["cell 10 FAILED (height=11): ZeroDivisionError: eleven"]
    if options:
        found = [json.loads(line) for line in text.splitlines()]
        assert {line["event"] for line in found} == {"begin", "failed", "progress", "end"}
        assert next(line for line in found if line["event"] == "failed")["values"] == {"height": "11"}
        assert found[-1]["exit"] == 4


@pytest.mark.parametrize("as_json", [False, True])
def test_a_log_goes_on_where_an_earlier_one_ended_and_holds_its_run_alone(tmp_path, as_json):
    path, before = tmp_path / "out.h5.log", (list(LOG.handlers), LOG.level)
    for text in ("one", "two\nlines \x1b[31m 100 %s"):
        with logging_to(path, as_json):
            log(text, cells=3)
        log("between")
    first, last = read_lines(path.read_text() + '{"time": \n')
    assert abs(datetime.fromisoformat(first["time"][:19]) - datetime.now()) < timedelta(minutes=5)
    assert last["text"] == ("two\nlines \x1b[31m 100 %s" if as_json else "two lines \\x1b[31m 100 %s")
    assert (list(LOG.handlers), LOG.level) == before


def test_a_pipe_in_the_place_of_the_log_is_told_and_not_waited_for(begun, tmp_path):
    os.mkfifo(log_path(tmp_path / "stones.h5"))
    process, _ = begun("slow:SLOW", 10)
    assert "stones.h5.log" in process.communicate(timeout=60)[1]
    assert process.returncode == 2


def test_how_it_ended_is_notified(command, tmp_path):
    notify = 'printf "%s|%s|%s" "$SWEEP_EXIT" "$SWEEP_OUTPUT" "$SWEEP_SUMMARY" > told'
    for name, begins in (("bad", "4|bad.h5|bad.h5: 20 cells: 19 ok"), ("none", "2|none.h5|none.toml")):
        command("run", f"{name}.toml", *OWN, "--notify", notify)
        assert (tmp_path / "told").read_text().startswith(begins)
    assert "--notify: " in command("run", "good.toml", *OWN, "--notify", "exit 3")[1]
