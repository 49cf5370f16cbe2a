"""The command line: what it does, and that no fault of a user or a machine ends in a traceback.

What it prints, word for word, stands in `tests/snapshots/`.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import sweep
from sweep.command.reading import explained
from sweep.errors import SweepError

STUDY = """# How fast does a stone fall?
title = "Falling stones"
kernel = "toy:KERNEL"
rtol = 1e-3
[axes.height]
spacing = "log"
start = 1
stop = 1000
num = 31
[axes.v0]
values = [0.0, 1.0, -1.0, nan]
[along.phase]
num = 5
"""
OWN = ("--allow-import", "--no-isolate")
FIT = ("fit", "stones.h5", "--y", "fall_time", "--x", "height")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder, which is the current one, with the study in it."""
    monkeypatch.chdir(tmp_path)
    Path("stones.toml").write_text(STUDY)
    return tmp_path


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("cli") / "stones.toml"
    path.write_text(STUDY)
    sweep.run(sweep.study(path, allow_import=True), path.with_suffix(".h5"), progress=False).close()
    return path.with_suffix(".h5")


@pytest.fixture
def done(here, result):
    """The same folder with the study computed."""
    shutil.copy(result, "stones.h5")
    return here


def in_a_process(*argv, **options):
    path = os.pathsep.join([str(Path(sweep.__file__).parents[1]), str(Path(__file__).parents[1] / "helpers")])
    pipes = {"env": {**os.environ, "PYTHONPATH": path}, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([sys.executable, *argv], text=True, **{**pipes, **options})


# processes


def test_an_output_that_takes_no_words_changes_no_exit_status(done):
    with Path("/dev/full").open("w") as full:
        for words in (("show", "nothing.h5"), ("studies",)):
            assert in_a_process("-m", "sweep", *words, stdout=full, stderr=full).wait(60) == 2
    with in_a_process("-m", "sweep", "list", stdout=None, preexec_fn=lambda: os.close(1)) as process:
        assert process.wait(60) == 0
    with in_a_process("-m", "sweep", "show", "stones.h5") as process:
        process.stdout.close()
        assert (process.wait(60), process.stderr.read()) == (0, "")


# kernels


def test_a_kernel_in_the_current_folder_is_described_as_it_is_run(here, call, monkeypatch):
    """Its module is not on the path of Python: the installed command has its own folder there, not the current one."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    Path("beside_me.py").write_text("from toy import KERNEL\n")
    code, out, err = call("kernels", "beside_me:KERNEL", "--allow-import")
    assert (code, err, "fall_time" in out) == (0, "", True)
    Path("deep").mkdir()
    Path("deep/below.py").write_text("from toy import KERNEL\n")
    assert call("kernels", "below:KERNEL", "--allow-import", "--study", "deep/below.toml")[0] == 0
    assert call("plan", "deep/below.toml", *OWN)[0] == 0


# plan, run, show


def test_plan_of_what_cannot_fit_is_a_mistake(here, call, monkeypatch):
    usage = shutil.disk_usage(".")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=10))
    code, out, err = call("plan", "stones.toml", *OWN)
    assert (code, "Falling stones" in out, "disk" in err) == (2, True, True)


def test_run_writes_where_it_is_told_and_leaves_a_finished_result_alone_unless_forced(here, call):
    Path("results").mkdir()
    assert call("run", "stones.toml", *OWN, "-o", "results/a.h5")[0] == 0
    assert sorted(path.name for path in here.iterdir()) == ["results", "stones.toml"]
    again = ("run", "stones.toml", *OWN, "-o", "results/a.h5")
    before = Path("results/a.h5").stat()
    assert "done before" in call(*again)[1]
    assert Path("results/a.h5").stat() == before
    code, out, _ = call(*again, "--force")
    assert (code, "done before" in out) == (0, False)
    assert Path("results/a.h5").stat() != before
    with sweep.open_result("results/a.h5") as dataset:
        np.testing.assert_allclose(dataset.fall_time.sel(height=1.0, v0=0.0), np.sqrt(2 / 9.80665), rtol=1e-15)


def test_what_others_have_written_does_not_command_the_terminal(here, call):
    title = "\\u001b]0;owned\\u0007\\u009b2JStones"
    Path("stones.toml").write_text(STUDY.replace("Falling stones", title) + "\n")
    for argv in (("plan", "stones.toml", *OWN), ("run", "stones.toml", *OWN)):
        assert call(*argv)[0] == 0
    assert r"\x1b]0;owned\x07\x9b2JStones" in call("show", "stones.h5")[1]
    assert call("plan", "\x1b[2J\udcff.toml") == (2, "", "\\x1b[2J\\udcff.toml: no such file\n")


# fit, export, diff, join


def test_fit_writes_its_table_by_what_the_reader_says(done, call):
    code, out, _ = call(*FIT, "--at", "v0=0", "-o", "laws.csv")
    assert (code, out.splitlines()[-1]) == (0, "laws.csv")
    table = pd.read_csv("laws.csv")
    assert table.law.tolist() == ["one"]
    assert table.exponent[0] == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--y", "fal_time"), "did you mean fall_time?"),
        (("--at", "v0"), "v0: expected"),
        (("--at", "v0=x"), "v0=x: expected"),
        (("--window", "10", "1", "--at", "v0=0"), "window"),
        (("--compare",), "--at v0=value"),
        (("--confidence", "95"), "confidence"),
    ],
)
def test_a_fit_that_cannot_be_made_is_told(done, call, options, message):
    code, out, err = call(*FIT, *options)
    assert (code, out) == (2, "")
    assert message in err


def test_an_export_has_the_cells_units_and_digits_asked_for(done, call):
    options = ("--compress", "--unit", "fall_time=ms", "--where", "v0 >= 0")
    assert call("export", "stones.h5", "-o", "stones.nc", *options)[0] == 0
    with xr.open_dataset("stones.nc") as found, sweep.open_result("stones.h5") as ds:
        assert found.fall_time.encoding["zlib"]
        wanted = 1e3 * ds.fall_time.values[:, :2].ravel()
        np.testing.assert_allclose(np.sort(found.fall_time.values.ravel())[: wanted.size], np.sort(wanted), 1e-6)
    code, _, err = call("export", "stones.h5", "-o", "x.csv", "--unit", "fall_time=kg")
    assert (code, "unit" in err) == (2, True)


def test_the_path_of_what_is_written_is_one_line_however_long_and_json_says_whether_it_is_whole(done, call):
    path = f"my results {'of stones ' * 12}.csv"
    assert call("export", "stones.h5", "-o", path)[1] == f"{path}\n"
    assert json.loads(call("verify", "stones.h5", "--json")[1])["whole"] is True


def test_two_results_are_joined(done, call):
    Path("old").mkdir()
    for name in ("old/a.h5", "a.h5"):
        shutil.copy("stones.h5", name)
    for options, labels in (
        (("stones.h5", "a.h5"), ["stones", "a"]),
        (("old/a.h5", "a.h5"), ["old/a.h5", "a.h5"]),
        (("old/a.h5", "a.h5", "--labels", "y", "x"), ["y", "x"]),
    ):
        assert call("join", *options, "--axis", "version", "-o", "both.h5", "--force")[0] == 0
        with sweep.open_result("both.h5") as both:
            assert both.version.values.tolist() == labels


# mistakes and faults


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (("run", "."), "folder"),
        (("show", "no.h5"), "no.h5"),
        (("show", "."), "directory"),
        (("run", "pipe.toml"), "pipe.toml"),
        (("run", "stones.toml", "--allow-import", "--cell-timeout", "soon"), "cell_timeout"),
        (("run", "stones.toml", "--allow-import", "-o", "nowhere/a.h5"), "nowhere"),
        (("run", "stones.toml", "--allow-import", "-o", "stones.toml"), "stones.toml"),
        (("run", "stones.toml", *OWN, "-o", "/proc/x.h5"), "/proc/x.h5"),
    ],
)
def test_a_mistake_ends_in_one_message_and_status_2(here, call, argv, message):
    """An output that cannot be written is named, and not the log, the lock or the folder beside it."""
    os.mkfifo("pipe.toml")
    code, out, err = call(*argv)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err
    assert "/proc" not in message or err.startswith(("/proc/x.h5 ", "/proc/x.h5:"))


def test_a_finished_result_without_room_for_its_log_is_done_before(done, call):
    """As in a folder that is read-only. What has to write there is told so."""
    Path("stones.h5.log").mkdir()
    code, out, _ = call("run", "stones.toml", *OWN)
    assert (code, "done before" in out) == (0, True)
    Path("new.h5.log").mkdir()
    code, _, err = call("run", "stones.toml", *OWN, "-o", "new.h5")
    assert (code, "new.h5.log" in err) == (2, True)


@pytest.mark.parametrize(
    "argv",
    [
        ("run", "stones.toml", *OWN),
        ("report", "stones.h5"),
        ("fit", "stones.h5", "--x", "height", "--y", "fall_time"),
        ("plot", "stones.h5"),
        ("export", "stones.h5"),
        ("refine", "stones.h5", *OWN, "--y", "fall_time", "--tolerance", "1e-2"),
        ("join", "stones.h5", "stones.h5", "--axis", "version", "--labels", "a", "b"),
    ],
)
@pytest.mark.parametrize("target", [".", "/", "mine.csv", "mine.html", "mine.h5", "mine.png", "mine.zarr"])
def test_no_folder_gives_way_to_what_a_command_writes(done, call, argv, target):
    """With --force either, and with no name in the path at all."""
    if target.startswith("mine"):
        Path(target).mkdir()
        Path(target, "letter").touch()
    code, _, err = call(*argv, "--force", "-o", target)
    assert (code, "is a folder" in err) == (2, True)
    assert not target.startswith("mine") or Path(target, "letter").exists()


@pytest.mark.parametrize(
    ("error", "code", "word"),
    [
        (SweepError("so"), 2, "so"),
        (KeyboardInterrupt(), 130, "stopped"),
        (SystemExit(143), 143, "stopped"),
        (SystemExit("words"), 1, "stopped"),
        (MemoryError(), 2, "memory"),
        (OSError(28, "No space left on device", "/x"), 2, "/x: No space"),
        (OSError("odd"), 2, "odd"),
        (OSError(-2, "Name or service not known"), 2, "Name or service"),
        (OSError(28, None), 2, "No space left"),
        (KeyError("x"), 1, "KeyError"),
    ],
)
def test_a_fault_has_its_status_and_its_words(error, code, word):
    found = explained(error)
    assert (found.code, word in found.text) == (code, True)


@pytest.mark.parametrize(("height", "nearest"), [("1e99", "1000 or 794.328"), ("-1", "1 or 1.25893"), ("2", "1.99526")])
def test_a_value_that_an_axis_has_not_is_told_with_those_next_to_it(done, call, height, nearest):
    code, _, err = call("cell", "stones.h5", f"height={height}", "v0=0")
    assert (code, f"nearest is {nearest}" in " ".join(err.split())) == (2, True)
