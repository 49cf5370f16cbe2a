"""A run ends when it is told to, whatever its kernel does; what became of it is in its exit status and its log."""

import io
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest
from running import environment, quiet, same, tall, wait_for

import sweep
from sweep.cli import main, parser
from sweep.results.statuses import account
from sweep.show.follow import follow, reasons
from sweep.store.store import unfinished_of
from sweep.system.errors import EXIT_CODES, SweepError
from sweep.system.log import log, log_path, logging_to, read_lines
from sweep.system.progress import passed

SECONDS = 2.0
"""What a run may take to end;"""
START = 8.0
"""and a machine with much to do to notice."""

STUDY = """
title = "Stones"
kernel = "{kernel}"
outputs = ["fall_time"]
[axes.height]
spacing = "linear"
start = 1
stop = {count}
num = {count}
"""


@pytest.fixture
def begun(tmp_path):
    """Begins a run by the command: the process, and its output."""
    processes = []

    def begin(kernel, count, *options):
        (tmp_path / "stones.toml").write_text(STUDY.format(kernel=kernel, count=count))
        words = [sys.executable, "-m", "sweep", "run", "stones.toml", "--allow-import", *options]
        keys = {"env": environment(), "cwd": tmp_path, "stderr": subprocess.PIPE, "text": True}
        process = subprocess.Popen(words, start_new_session=True, **keys)
        processes.append(process)
        return process, tmp_path / "stones.h5"

    yield begin
    for process in processes:
        process.kill()
        process.communicate()


def solved(output):
    """How many cells are kept; 0 before the run has begun."""
    try:
        with sweep.open_result(output) as found:
            return account(found).ok
    except SweepError:
        return 0


def ended(process, begun):
    process.communicate(timeout=60)
    return time.monotonic() - begun


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("options", [["--cell-timeout", "10 min"], ["--no-isolate"]])
def test_a_kernel_that_never_ends_does_not_keep_a_run_from_it(begun, number, options):
    process, output = begun("bad:STUCK", 400, *options)
    wait_for(lambda: solved(output) >= 300, process)
    kept = solved(output)
    at = time.monotonic()
    process.send_signal(number)
    assert ended(process, at) < SECONDS + START
    assert process.returncode == 128 + number
    assert solved(output) >= kept
    last = list(read_lines(log_path(output).read_text()))[-1]["text"]
    assert last == f"ended with {128 + number}: stopped"


def test_of_a_run_that_is_killed_no_process_is_left(begun):
    """Not even one in a kernel that never lets Python run."""
    psutil = pytest.importorskip("psutil")
    process, output = begun("bad:HOGGING", 60, "--cell-timeout", "10 min")
    wait_for(lambda: log_path(output).exists() and "begins" in log_path(output).read_text(), process)
    time.sleep(3.0)
    below = psutil.Process(process.pid).children(recursive=True)
    assert len(below) >= 3
    process.kill()
    process.wait()
    _, left = psutil.wait_procs(below, timeout=20)
    assert left == []


def test_a_pipe_in_the_place_of_the_log_is_told_and_not_waited_for(begun, tmp_path):
    os.mkfifo(log_path(tmp_path / "stones.h5"))
    process, _ = begun("slow:SLOW", 10)
    assert "stones.h5.log" in process.communicate(timeout=60)[1]
    assert process.returncode == 2


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
    assert time.monotonic() - at < SECONDS + START
    assert (process.returncode, str(unfinished_of(output)) in said) == (3, True)
    moved = {"renamed": tmp_path / "here" / "other", "folder moved": unfinished_of(tmp_path / "moved" / "stones.h5")}
    if deed in moved:
        assert str(moved[deed]) in said
        moved[deed].rename(unfinished_of(tmp_path / "back.h5"))
        assert solved(tmp_path / "back.h5") >= kept


def test_a_machine_that_sleeps_costs_no_cell(begun):
    """All processes of the run are stopped for longer than a cell may take, some of them inside cells."""
    process, output = begun("bad:SLOW", 200, "--cell-timeout", "1.5 s")
    wait_for(lambda: solved(output) >= 20, process)
    os.killpg(process.pid, signal.SIGSTOP)
    time.sleep(4.0)
    os.killpg(process.pid, signal.SIGCONT)
    process.communicate(timeout=120)
    assert process.returncode == 0
    assert solved(output) == 200


def test_until_goes_by_the_clock_on_the_wall_however_it_jumps(monkeypatch):
    """Half an hour before its time a laptop is shut for an hour: the run ends when it wakes. Set back, it goes on."""
    until = datetime(2027, 1, 31, 7, 0).astimezone()
    for at, over in (((6, 30), False), ((7, 30), True), ((6, 45), False), ((7, 0), True)):
        clock = SimpleNamespace(now=lambda at=at: datetime(2027, 1, 31, *at))
        monkeypatch.setattr("sweep.system.progress.datetime", clock)
        assert passed(until) is over


def test_clocks_that_jump_change_nothing_but_the_forecast(tmp_path, monkeypatch):
    """Those of the run leap by an hour, forth and back, at every look."""
    leaps = itertools.cycle([0.0, 3600.0, 7200.0, -3600.0])
    steady = time.monotonic

    def now():
        return steady() + next(leaps)

    leaping = SimpleNamespace(monotonic=now, perf_counter=now, sleep=time.sleep, strftime=time.strftime)
    whole = quiet(tall(60))
    for module in ("runs.session", "runs.isolate", "store.store", "system.forecast", "system.progress", "cells.timing"):
        monkeypatch.setattr(f"sweep.{module}.time", leaping)
    for path, keys in (("a.h5", {}), ("b.h5", {"isolate": True})):
        with quiet(tall(60), tmp_path / path, progress=io.StringIO(), **keys) as found:
            same(found, whole)


def test_it_ends_at_its_time_although_kernels_never_do(begun):
    at = datetime.now() + timedelta(seconds=8)
    process, _ = begun("bad:ENDLESS", 100, "--cell-timeout", "10 min", "--until", at.isoformat())
    process.communicate(timeout=60)
    assert datetime.now() - at < timedelta(seconds=SECONDS + START)
    assert process.returncode == 3


def test_what_is_given_up_is_not_stored_later(tmp_path, monkeypatch):
    """A thread in a kernel that ends after all finds its run ended."""
    output = tmp_path / "out.h5"
    monkeypatch.setattr("bad.HANGS", 44.0)
    monkeypatch.setattr("sweep.system.pool.GRACE_SECONDS", 0.2)
    monkeypatch.setattr("sweep.system.pool._endless.set", lambda: None)
    monkeypatch.setattr("time.sleep", lambda seconds, real=time.sleep: real(min(seconds, 3.0)))
    found = quiet(tall(60, "bad:STUCK"), output, until=datetime.now() + timedelta(seconds=1.5), block_cells=5)
    kept = account(found).ok
    assert kept == 55
    time.sleep(3.0)
    assert solved(output) == kept


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Runs a command in an empty folder: its exit status, and what it printed."""
    monkeypatch.chdir(tmp_path)

    def call(*words):
        code = main(list(words))
        printed = capsys.readouterr()
        return code, printed.out + printed.err

    (tmp_path / "good.toml").write_text(STUDY.format(kernel="toy:KERNEL", count=5))
    (tmp_path / "bad.toml").write_text(STUDY.format(kernel="bad:RAISING", count=20))
    return call


def test_the_exit_status_says_what_became_of_the_run(command):
    run = ("--allow-import", "--no-isolate")
    assert command("run", "good.toml", "--until", "2001-01-01", *run)[0] == 3
    assert command("run", "good.toml", *run)[0] == 0
    assert command("run", "bad.toml", *run)[0] == 4
    assert command("run", "bad.toml", *run)[0] == 4
    assert command("run", "none.toml", *run)[0] == 2
    told = parser().format_help()
    assert all(re.search(rf"^ *{code}  {re.escape(text)}$", told, re.MULTILINE) for code, text in EXIT_CODES.items())


def test_the_page_of_exit_statuses_has_the_same_table():
    text = (Path(__file__).parents[3] / "docs" / "exit_codes.md").read_text()
    assert all(f"| {code} | {meaning} |" in text for code, meaning in EXIT_CODES.items())


def test_what_cannot_fit_is_a_mistake(command, monkeypatch):
    monkeypatch.setattr("sweep.explore.plan.memory", lambda: 1)
    code, told = command("plan", "good.toml", "--allow-import")
    assert code == 2
    assert "the memory is too small" in told


def test_an_unfinished_result_is_reported_exported_and_fitted_only_when_that_is_meant(command):
    assert command("run", "good.toml", "--allow-import", "--no-isolate", "--until", "2001-01-01")[0] == 3
    commands = [
        ("report", "good.h5"),
        ("export", "good.h5", "-o", "good.csv"),
        ("fit", "good.h5", "--y", "fall_time", "--x", "height"),
    ]
    for words in commands:
        code, told = command(*words)
        assert code == 2
        assert "good.h5: unfinished" in told
        assert "--unfinished" in told
    assert command(*commands[0], "--unfinished")[0] == 0
    assert command(*commands[1], "--unfinished")[0] == 0
    assert command("run", "good.toml", "--allow-import", "--no-isolate")[0] == 0
    for words in commands:
        assert command(*words, "--force")[0] == 0


def test_show_names_the_cells_that_failed_and_why(command, tmp_path):
    command("run", "bad.toml", "--allow-import", "--no-isolate")
    assert "cell 10  height=11.0  ZeroDivisionError: eleven" in command("show", "bad.h5")[1]
    assert reasons(tmp_path / "bad.h5") == {10: "ZeroDivisionError: eleven"}
    log_path(tmp_path / "bad.h5").unlink()
    assert "cell 10  height=11.0" in command("show", "bad.h5")[1]


@pytest.mark.parametrize("options", [[], ["--log-json"]])
def test_the_log_tells_of_the_run_from_its_beginning_to_its_end(command, tmp_path, options):
    command("run", "bad.toml", "--allow-import", "--no-isolate", *options)
    text = log_path(tmp_path / "bad.h5").read_text()
    lines = list(read_lines(text))
    first, last = lines[0]["text"], lines[-1]["text"]
    assert all(word in first for word in ("begins: bad.h5", "bad:RAISING", "numba", "foliot", "process"))
    assert last.startswith("ended with 4: bad.h5: 20 cells: 19 ok")
    assert [line["text"] for line in lines if "FAILED (" in line["text"]] == [
        "cell 10 FAILED (height=11): ZeroDivisionError: eleven"
    ]
    assert list(follow(tmp_path / "bad.h5"))[-1].endswith(last.splitlines()[-1])
    if options:
        found = [json.loads(line) for line in text.splitlines()]
        assert {line["event"] for line in found} == {"begin", "failed", "progress", "end"}
        assert next(line for line in found if line["event"] == "failed")["values"] == {"height": "11"}
        assert found[-1]["exit"] == 4


def test_a_log_is_followed_until_its_run_ends(tmp_path):
    output, turns = tmp_path / "out.h5", []
    with logging_to(log_path(output)):
        log("begins")
        steps = {1: "half", 2: "ended with 0: whole"}

        def sleep(seconds):
            turns.append(seconds)
            if len(turns) in steps:
                log(steps[len(turns)])

        assert [line[21:] for line in follow(output, sleep)] == ["begins", "half", "ended with 0: whole"]
        log("begins")
        with pytest.raises(SweepError, match="nothing new for 600 s"):
            list(follow(output, lambda seconds: None))
    with pytest.raises(SweepError, match="no log to follow"):
        list(follow(tmp_path / "other.h5"))


def test_how_it_ended_is_notified(command, tmp_path):
    notify = 'printf "%s|%s|%s" "$SWEEP_EXIT" "$SWEEP_OUTPUT" "$SWEEP_SUMMARY" > told'
    command("run", "bad.toml", "--allow-import", "--no-isolate", "--notify", notify)
    assert (tmp_path / "told").read_text().startswith("4|bad.h5|bad.h5: 20 cells: 19 ok")
    command("run", "none.toml", "--notify", notify)
    assert (tmp_path / "told").read_text().startswith("2|none.h5|none.toml")
    assert "--notify: " in command("run", "good.toml", "--allow-import", "--no-isolate", "--notify", "exit 3")[1]
