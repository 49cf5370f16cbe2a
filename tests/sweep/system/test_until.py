"""Runs that end early: at a time of day, on SIGTERM."""

import io
import os
import signal
import time
from datetime import datetime, timedelta

import pytest
from running import kept, quiet, same, slow_run, tall, wait_for

import sweep
from sweep.cli import main
from sweep.results.statuses import account
from sweep.store import store
from sweep.store.frame import Frame
from sweep.system.errors import SweepError
from sweep.system.pool import Terminated
from sweep.system.progress import deadline


def test_a_time_of_day_is_the_next_one_and_a_date_that_moment():
    now = datetime(2026, 11, 21, 7).astimezone()
    for text, hours in (("07:00", 24), (" 23:59 ", 17 - 1 / 60), ("06:59", 24 - 1 / 60), ("2026-11-20 07:00", -24)):
        assert deadline(text, now) == now + timedelta(hours=hours)


@pytest.mark.parametrize("place", ["UTC", "America/Los_Angeles", "Asia/Tokyo", "Pacific/Kiritimati"])
@pytest.mark.parametrize("hours", range(0, 24, 3))
def test_a_time_with_a_zone_is_less_than_a_day_ahead_wherever_it_is_read(monkeypatch, place, hours):
    """Its date is that of its own zone, where it may be tomorrow already, or still yesterday."""
    monkeypatch.setenv("TZ", place)
    time.tzset()
    now = datetime.fromisoformat("2026-11-21T00:30+00:00") + timedelta(hours=hours)
    try:
        for text in ("04:00+09:00", "04:00-08:00", "23:00+14:00", "00:10-11:00"):
            found = deadline(text, now)
            assert timedelta(0) < found - now <= timedelta(days=1)
            assert found.astimezone(datetime.fromisoformat(f"2026-11-21T{text}").tzinfo).strftime("%H:%M") == text[:5]
    finally:
        monkeypatch.undo()
        time.tzset()


@pytest.mark.parametrize("text", ["7 o'clock", "", "25:00", "in the morning", 7])
def test_what_is_no_time_is_told(text, tmp_path):
    with pytest.raises(SweepError, match="until: expected a time"):
        quiet(tall(3), tmp_path / "out.h5", until=text)


def test_a_run_ends_at_its_time_with_what_there_is_and_continues(tmp_path):
    output, study, log = tmp_path / "out.h5", tall(5000, "slow:SLOW"), io.StringIO()
    begun = datetime.now()
    found = quiet(study, output, until=begun + timedelta(seconds=2), block_cells=10, progress=log)
    assert datetime.now() - begun < timedelta(seconds=10)
    told = account(found)
    assert 0 < told.ok < 5000
    assert told.ok + told.pending == told.total == 5000
    assert "run the same command again to continue" in log.getvalue()
    assert len(kept(output)) == told.ok // 10
    fast = tall(5000, "slow:SLOW")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slow.CELL_SECONDS", 0.0)
        same(quiet(fast, output, until="2999-01-01"), quiet(fast))
    assert list(tmp_path.iterdir()) == [output]


def test_a_time_that_is_over_computes_next_to_nothing_and_exits_with_3(tmp_path, read, capsys):
    read("axes.height = [1.0, 2.0, 3.0]\n")
    arguments = ["run", str(tmp_path / "fall.toml"), "-o", str(tmp_path / "out.h5"), "--allow-import"]
    assert main([*arguments, "--until", "2001-01-01"]) == 3
    assert "unfinished; " in capsys.readouterr().out
    assert main(arguments) == 0
    assert "3 cells: 3 ok, 0 remarked, 0 refused, 0 unsolved, 0 FAILED, 0 pending" in capsys.readouterr().out
    assert main([*arguments, "--until", "noon"]) == 2


def test_a_time_needs_an_output():
    with pytest.raises(SweepError, match="give a path"):
        quiet(tall(3), until="07:00")


def test_sigterm_ends_within_a_block_with_143_and_the_next_start_tidies_up(tmp_path):
    output = tmp_path / "out.h5"
    with slow_run(output, 2, 10) as process:
        wait_for(lambda: len(kept(output)) >= 2, process)
        process.send_signal(signal.SIGTERM)
        _, told = process.communicate(timeout=30)
    assert process.returncode == 143
    assert "run the same command again to continue" in told
    assert "Traceback" not in told
    assert len(kept(output)) >= 2
    output.with_name("out.h5.unfinished.tmp").write_bytes(b"half")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slow.CELL_SECONDS", 0.0)
        same(quiet(tall(400, "slow:SLOW"), output), quiet(tall(400, "slow:SLOW")))
    assert list(tmp_path.iterdir()) == [output]


@pytest.mark.parametrize("name", ["write", "write_digests", "end", "reads_back"])
def test_sigterm_at_the_beginning_and_the_end_leaves_no_file_half_written(tmp_path, name):
    output, log = tmp_path / "out.h5", io.StringIO()
    home = Frame if name == "write" else store
    real = getattr(home, name)

    struck_once = []

    def struck(*rest):
        if not struck_once:
            struck_once.append(rest)
            os.kill(os.getpid(), signal.SIGTERM)
        return real(*rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(home, name, struck)
        with pytest.raises(Terminated):
            quiet(tall(50), output, block_cells=10, progress=log)
    assert not list(tmp_path.rglob("*.tmp"))
    assert output.exists() != ("run the same command again" in log.getvalue())
    same(quiet(tall(50), output), quiet(tall(50)))
    assert list(tmp_path.iterdir()) == [output]


def test_an_unfinished_extension_returns_what_there_is_of_the_new_one(tmp_path):
    output = tmp_path / "out.h5"
    quiet(tall(5), output).close()
    found = quiet(tall(9), output, extend=True, until="2001-01-01", block_cells=2)
    assert account(found).total == 9
    with sweep.open_result(output) as old:
        assert old.sizes["height"] == 5
