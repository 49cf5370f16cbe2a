"""The command line: what it prints, and that no fault of a user or a machine ends in a traceback."""

import io
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from running import kept
from toy_studies import HEAD

import sweep
from sweep import cli
from sweep.command import running
from sweep.system.progress import Progress

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


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder, which is the current one, with the study in it."""
    monkeypatch.chdir(tmp_path)
    Path("stones.toml").write_text(STUDY)
    return tmp_path


@pytest.fixture
def call(capsys):
    """Runs a command: exit status, what it printed, what it complained of."""

    def call(*argv):
        code = cli.main([str(word) for word in argv])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return call


@pytest.fixture
def done(here, call):
    """The same folder with the study computed."""
    assert call("run", "stones.toml", "--allow-import")[0] == 0
    return here


def paths():
    """The environment of a process that finds the package and the helpers."""
    path = os.pathsep.join([str(Path(sweep.__file__).parents[1]), str(Path(__file__).parents[1] / "helpers")])
    return {**os.environ, "PYTHONPATH": path}


def in_a_process(*argv, **options):
    command = [sys.executable, "-m", "sweep", *argv]
    return subprocess.Popen(
        command,
        env=paths(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


# where nothing can be printed


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no disk that is always full")
def test_words_that_find_no_room_leave_the_exit_status(here):
    with Path("/dev/full").open("w") as full:
        for words, status in ((["show", "nothing.h5"], 2), (["studies"], 2)):
            command = [sys.executable, "-m", "sweep", *words]
            assert subprocess.run(command, env=paths(), stdout=full, stderr=full).returncode == status


def test_a_closed_stdout_is_no_fault(here):
    command = [sys.executable, "-m", "sweep", "list"]
    assert subprocess.run(command, env=paths(), preexec_fn=lambda: os.close(1)).returncode == 0


# what is quick


@pytest.mark.parametrize("statement", ["import sweep", "import sweep.cli; sweep.cli.parser()"])
def test_nothing_heavy_is_imported_before_it_is_needed(statement):
    heavy = "{'numpy', 'numba', 'xarray', 'pint', 'h5py', 'matplotlib', 'dask'}"
    code = f"import sys; {statement}; assert not {heavy} & set(sys.modules), {heavy} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(sweep.__file__).parents[1])


def test_a_study_without_foreign_units_is_read_without_pint(here):
    code = "import sys, sweep; sweep.study('stones.toml', True); assert not {'pint', 'xarray'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, env=paths())


# public names


def test_every_public_name_is_there():
    for name in sweep.__all__:
        assert callable(getattr(sweep, name)), name
    assert dir(sweep) == sorted(sweep.__all__)


def test_an_unknown_name_is_no_attribute():
    with pytest.raises(AttributeError, match="no attribute 'runn'"):
        sweep.runn  # noqa: B018


# kernels


def test_kernels_lists_the_catalogue(call):
    code, out, _ = call("kernels")
    assert code == 0
    assert "foliot: " in out
    assert "mu [rad/s^2]" in out
    assert "closed" in out


def test_a_kernel_is_told_with_all_it_takes_and_gives(call):
    code, out, _ = call("kernels", "toy:KERNEL", "--allow-import")
    assert code == 0
    for line in (
        "toy:KERNEL: A stone thrown downwards from a height.",
        "height  [m]      > 0   required         height above the ground",
        "v0      [m/s]    >= 0  default 0        downward speed at the start",
        "drop          [m]    along phase  way fallen",
        "rough  states its error  no initial speed",
        "exact  keeps rtol        root of the quadratic",
    ):
        assert line in out


@pytest.mark.parametrize("kernel", ["toy:KERNEL", "toy:RICH", "foliot"])
def test_the_study_to_begin_with_is_sound(call, here, kernel):
    _, out, _ = call("kernels", kernel, "--allow-import")
    text = out.split("a study to begin with\n")[1]
    Path("begin.toml").write_text(text)
    assert sweep.study("begin.toml", allow_import=True).kernel_name == kernel


def test_words_and_what_a_method_cannot_do_are_told(call):
    _, out, _ = call("kernels", "toy:RICH", "--allow-import")
    assert '"round" or "square"' in out
    assert "default load" in out
    assert "cannot do drag or grip" in out


def test_an_unknown_kernel_is_told_with_the_catalogue(call):
    code, out, err = call("kernels", "folio")
    assert (code, out) == (2, "")
    assert 'no kernel "folio"; did you mean foliot?' in err


# plan, run, show


def test_plan_tells_the_number_of_cells(here, call):
    code, out, _ = call("plan", "stones.toml", "--allow-import")
    assert code == 0
    assert "124" in out


def test_plan_of_what_cannot_fit_is_a_mistake(here, call, monkeypatch):
    usage = shutil.disk_usage(".")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=10))
    code, out, err = call("plan", "stones.toml", "--allow-import")
    assert code == 2
    assert "Falling stones" in out
    assert "stones.toml: the disk is too small: " in err


def test_run_writes_beside_the_caller_and_counts_what_failed(here, call):
    code, out, err = call("run", "stones.toml", "--allow-import")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].startswith(
        "stones.h5: 124 cells: 62 ok, 0 remarked, 62 refused, 0 unsolved, 0 FAILED, 0 pending; solved by rough "
    )
    assert lines[1].startswith("62 of 124 cells: BAD_INPUT, e.g. height=1.0 v0=-1.0")
    with sweep.open_result("stones.h5") as dataset:
        np.testing.assert_allclose(dataset.fall_time.sel(height=1.0, v0=0.0), np.sqrt(2 / 9.80665), rtol=1e-15)


def test_run_again_leaves_a_finished_result_alone(done, call):
    before = Path("stones.h5").stat()
    code, out, _ = call("run", "stones.toml", "--allow-import")
    assert code == 0
    assert out.startswith("stones.h5: done before; 124 cells")
    assert Path("stones.h5").stat() == before


def test_force_computes_anew(done, call):
    before = Path("stones.h5").stat().st_ino, Path("stones.h5").stat().st_mtime_ns
    code, out, _ = call("run", "stones.toml", "--allow-import", "--force")
    assert code == 0
    assert "done before" not in out
    assert before != (Path("stones.h5").stat().st_ino, Path("stones.h5").stat().st_mtime_ns)


def test_what_others_have_written_does_not_command_the_terminal(here, call):
    title = "\\u001b]0;owned\\u0007\\u009b2JStones"
    Path("stones.toml").write_text(STUDY.replace("Falling stones", title) + "\n")
    for argv in (("plan", "stones.toml", "--allow-import"), ("run", "stones.toml", "--allow-import")):
        assert call(*argv)[0] == 0
    code, out, _ = call("show", "stones.h5")
    assert code == 0
    assert r"\x1b]0;owned\x07\x9b2JStones" in out
    assert call("plan", "\x1b[2J\udcff.toml") == (2, "", "\\x1b[2J\\udcff.toml: no such file\n")


def test_progress_is_told_without_commands_to_the_terminal():
    stream = io.StringIO()
    Progress(1, stream, "\x1b[2Jstones").note("begun")
    assert "\x1b" not in stream.getvalue()


def test_the_result_of_another_study_is_not_overwritten(done, call):
    Path("stones.toml").write_text(STUDY.replace("num = 31", "num = 4"))
    code, out, err = call("run", "stones.toml", "--allow-import")
    assert (code, out) == (2, "")
    assert "stones.h5" in err
    assert "--force" in err
    assert "axes.height: was 31 values" in err


def test_run_writes_where_it_is_told(here, call):
    (here / "results").mkdir()
    assert call("run", "stones.toml", "--allow-import", "-o", "results/a.h5")[0] == 0
    assert Path("results/a.h5").exists()
    assert not Path("stones.h5").exists()


def test_show_tells_what_is_in_a_result(done, call):
    code, out, err = call("show", "stones.h5")
    assert (code, err) == (0, "")
    for text in (
        "stones.h5: complete, 124 cells\nFalling stones\nHow fast does a stone fall?",
        "kernel    toy:KERNEL",
        "height  [m]    31 values  1 to 1000",
        "v0      [m/s]  4 values   0, 1, -1, nan",
        "g  [m/s^2]  9.80665",
        "phase  [1]  5 values  0, 0.25, 0.5, 0.75, 1",
        "62  OK",
    ):
        assert text in out
    assert "v0 -1 and nan; e.g. height=1.0 v0=-1.0" in " ".join(out.split())
    assert "fall_time     [s]" in out


def test_show_tells_how_much_of_a_sweep_is_done(here, call):
    process = slow_run()
    wait_for(lambda: len(kept(Path("slow.h5"))) >= 2)
    code, out, _ = call("show", "slow.h5")
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=20)
    assert code == 0
    assert "slow.h5: unfinished: " in out
    assert "PENDING" in out


# fit, plot, export


def test_fit_writes_its_table(done, call):
    code, out, _ = call("fit", "stones.h5", "--y", "fall_time", "--x", "height", "--at", "v0=0", "-o", "laws.csv")
    assert (code, out.splitlines()[-1]) == (0, "laws.csv")
    table = pd.read_csv("laws.csv")
    assert table.law.tolist() == ["one"]
    assert table.exponent[0] == pytest.approx(0.5, abs=1e-12)
    assert table.exponent_low[0] <= 0.5 <= table.exponent_high[0]
    assert call("fit", "stones.h5", "--y", "fall_time", "--x", "height", "--confidence", "95")[0] == 2


def test_of_a_scene_the_interval_is_fitted_and_drawn_with_the_digits_that_it_has(here, call):
    study = {"kernel": "rich_scene:RICH", "allow_import": True, "fixed": {"phi0": 1.0, "a": 1.0, "flips": 6}}
    ds = sweep.run(**study, axes={"mu": np.geomspace(0.1, 10.0, 12)}, path="scene.h5", progress=False)
    code, out, _ = call("fit", "scene.h5", "--x", "mu")
    assert code == 0
    title, _, row, *_ = out.splitlines()
    assert title == "interval ~ mu^p"
    (exponent,) = re.findall(r" (-0\.\d+)  +runs from", row)
    assert exponent == f"{float(sweep.fit_exponent(ds.interval, 'mu').exponent):.2g}"
    assert call("fit", "scene.h5", "--x", "mu", "--compare")[0] == 0
    assert "time between the last two switches" in sweep.plot(ds).axes[0].get_ylabel()


def test_fit_tells_of_cells_that_are_not_ok(done, call):
    code, out, _ = call("fit", "stones.h5", "--y", "fall_time", "--x", "height")
    assert code == 0
    assert "Of 124 cells: 62 BAD_INPUT (left out)." in out
    assert "Of " not in call("fit", "stones.h5", "--y", "fall_time", "--x", "height", "--at", "v0=0")[1]


def test_fit_takes_the_readers_word_on_noise(done, call):
    for word, noisy in (("yes", 1.0), ("no", 0.0)):
        options = ("--y", "fall_time", "--x", "height", "--at", "v0=0", "--noise", word, "-o", "laws.csv")
        assert call("fit", "stones.h5", *options)[0] == 0
        assert pd.read_csv("laws.csv").noisy[0] == noisy


def test_fit_compares_laws_in_words_a_table_and_a_picture(done, call):
    options = ("fit", "stones.h5", "--y", "fall_time", "--x", "height", "--at", "v0=1", "--compare")
    code, out, _ = call(*options)
    assert code == 0
    assert "Chosen: " in out
    assert all(law in out for law in ("one law", "logarithm", "offset", "correction to scaling", "three laws"))
    assert call(*options, "-o", "laws.csv")[0] == 0
    table = pd.read_csv("laws.csv")
    assert table.chosen.sum() == 1
    assert table.worse.min() == 0
    assert call(*options, "-o", "laws.png")[0] == 0
    assert Path("laws.png").read_bytes().startswith(b"\x89PNG")


def test_laws_are_compared_along_one_line_alone(done, call):
    code, _, err = call("fit", "stones.h5", "--y", "fall_time", "--x", "height", "--compare")
    assert (code, "choose with --at v0=value" in err) == (2, True)
    code, _, err = call("fit", "stones.h5", "--y", "fal", "--x", "height", "--compare")
    assert (code, "no such output" in err) == (2, True)


def test_fit_tells_the_exponent(done, call):
    code, out, err = call("fit", "stones.h5", "--y", "fall_time", "--x", "height", "--at", "v0=0")
    assert (code, err) == (0, "")
    assert "fall_time ~ height^p" in out
    assert "1 to 1000  0.5 " in out
    assert "31" in out


def test_two_windows_tell_where_the_laws_meet(done, call):
    windows = ("--window", "100", "1000", "--window", "1", "10")
    code, out, _ = call("fit", "stones.h5", "--y", "fall_time", "--x", "height", "--at", "v0=1", *windows)
    assert code == 0
    assert out.index("1 to 10 ") < out.index("100 to 1000 ")
    assert "the two laws meet" in out


def test_without_a_choice_every_other_axis_has_its_line(done, call):
    code, out, _ = call("fit", "stones.h5", "--y", "impact_speed", "--x", "height", "--at", "v0=1")
    assert (code, len(out.split("\n\n")[0].splitlines())) == (0, 3)
    Path("all.toml").write_text(STUDY.replace("-1.0, nan", "2.0, 3.0"))
    call("run", "all.toml", "--allow-import")
    code, out, _ = call("fit", "all.h5", "--y", "impact_speed", "--x", "height")
    assert (code, len(out.split("\n\n")[0].splitlines())) == (0, 6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--y", "fal_time", "--x", "height"), "--y fal_time: no such output; did you mean fall_time?"),
        (("--y", "fall_time", "--x", "heigth", "--at", "v0=0"), "did you mean height?"),
        (("--y", "fall_time", "--x", "height", "--at", "v0"), "--at v0: expected axis=value"),
        (("--y", "fall_time", "--x", "height", "--at", "v1=0"), "--at v1=0: no axis v1; did you mean v0?"),
        (("--y", "fall_time", "--x", "height", "--at", "v0=0.4"), "v0 has no such value; nearest is 0 or 1"),
        (("--y", "fall_time", "--x", "height", "--at", "v0=x"), "--at v0=x: expected a number after ="),
        (("--y", "fall_time", "--x", "height", "--window", "10", "1", "--at", "v0=0"), "the window 10 to 1"),
        (("--y", "fall_time", "--x", "height", *("--window", "1", "9") * 3), "--window: expected one or two, found 3"),
    ],
)
def test_a_fit_that_cannot_be_made_is_told(done, call, options, message):
    code, out, err = call("fit", "stones.h5", *options)
    assert (code, out) == (2, "")
    assert message in err


def test_export_writes_csv(done, call):
    code, out, _ = call("export", "stones.h5", "-o", "stones.csv")
    assert (code, out) == (0, "stones.csv\n")
    assert "fall_time" in Path("stones.csv").read_text()


def test_an_exported_column_is_an_axis_of_the_next_study(done, call):
    call("export", "stones.h5", "-o", "stones.csv")
    Path("again.toml").write_text(HEAD + 'design = "zip"\naxes.height.file = "stones.csv"\naxes.v0.file = "stones.csv"')
    study = sweep.study("again.toml", allow_import=True)
    assert set(study.axes["height"].values) == set(sweep.open_result("stones.h5").height.values)


def test_plot_writes_a_picture(done, call):
    code, out, err = call("plot", "stones.h5", "--y", "fall_time", "--x", "height", "--at", "v0=1")
    assert (code, out, err) == (0, "stones_plot.png\n", "")
    assert Path("stones_plot.png").read_bytes().startswith(b"\x89PNG")


# mistakes and faults


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (("run", "no.toml"), "no.toml: no such file"),
        (("run", "stone.toml"), "did you mean stones.toml?"),
        (("run", "."), "is a folder"),
        (("run", "study.py"), "run it with: python study.py"),
        (("run", "stones.h5"), "is a result, not a study; look at it with: sweep show stones.h5"),
        (("show", "stones.toml"), "is a study, not a result; compute it with: sweep run stones.toml"),
        (("show", "no.h5"), "no.h5"),
        (("plan", "pipe.toml"), "pipe.toml is no regular file"),
        (("run", "pipe.toml"), "pipe.toml is no regular file"),
        (("run", "stones.toml"), "allow it with --allow-import"),
        (("run", "stones.toml", "--allow-import", "--workers", "0"), "workers"),
        (("run", "stones.toml", "--allow-import", "-o", "nowhere/a.h5"), "nowhere"),
        (("run", "stones.toml", "--allow-import", "-o", "stones.toml"), "stones.toml"),
        (("plan", "broken.toml", "--allow-import"), "broken.toml: 4 mistakes"),
        (("export", "no.h5", "-o", "a.csv"), "no.h5"),
    ],
)
def test_a_mistake_ends_in_one_message_and_status_2(here, call, argv, message):
    os.mkfifo("pipe.toml")
    Path("broken.toml").write_text('kernel = "toy:KERNEL"\nrtol = 2\n')
    code, out, err = call(*argv)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    "argv", [(), ("rum", "x"), ("fit", "x.h5"), ("fit", "x.h5", "--y", "a", "--x", "b", "--window", "1", "b")]
)
def test_a_misused_command_shows_its_usage(argv, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(list(argv))
    assert caught.value.code == 2
    assert "usage: sweep" in capsys.readouterr().err


def test_a_fault_of_ours_is_one_message_too(here, call, monkeypatch):
    monkeypatch.setattr(running, "study_from", lambda arguments: 1 / 0)
    code, _, err = call("run", "stones.toml")
    assert code == 1
    assert err.startswith("a fault in foliot: ZeroDivisionError: division by zero\nPlease report it")
    monkeypatch.setenv("SWEEP_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        call("run", "stones.toml")


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (MemoryError(), 2, "out of memory"),
        (OSError(28, "No space left on device", "/x/y"), 2, "/x/y: No space left on device"),
        (KeyboardInterrupt(), 130, "stopped"),
    ],
)
def test_faults_of_the_machine_are_told_in_one_line(here, call, monkeypatch, error, code, message):
    def fail(arguments):
        raise error

    monkeypatch.setattr(running, "study_from", fail)
    found, _, err = call("run", "stones.toml")
    assert found == code
    assert message in err
    assert len(err.splitlines()) == 1


def test_a_reader_who_has_had_enough_is_no_fault(done):
    process = in_a_process("show", "stones.h5", cwd=done)
    process.stdout.close()
    assert process.wait(timeout=60) == 0
    with process.stderr:
        assert process.stderr.read() == ""


SLOW = """
import time, numpy as np
from dataclasses import replace
from toy import KERNEL, exact, check
def slow(height, v0, g, rtol, phase, *outputs):
    time.sleep(0.01 * len(height))
    exact(height, v0, g, rtol, phase, *outputs)
KERNEL = replace(KERNEL, methods=(replace(KERNEL.methods[1], solve=slow),))
"""


def slow_run():
    Path("slowstones.py").write_text(SLOW)
    Path("slow.toml").write_text(
        'kernel = "slowstones:KERNEL"\noutputs = ["fall_time"]\n'
        'axes.height = { spacing = "log", start = 1, stop = 9, num = 2000 }'
    )
    return in_a_process("run", "slow.toml", "--allow-import", "--workers", "2")


def wait_for(condition):
    limit = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < limit, "waited for a minute"
        time.sleep(0.05)


def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(here):
    process = slow_run()
    wait_for(lambda: len(kept(Path("slow.h5"))) >= 2)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "continue" in err
    assert "Traceback" not in err
    assert len(kept(Path("slow.h5"))) >= 2
    assert not Path("slow.h5").exists()


def test_a_limit_that_leaves_a_round_number_out_is_told_so(call):
    code, out, _ = call("kernels", "impact")
    assert code == 0
    assert re.search(r"^  e +\[1\] +>= 0, < 1 ", out, re.MULTILINE)


def test_a_study_to_begin_with_is_written_and_runs(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("kernels", "foliot_motion", "--study", "motion.toml")[:2] == (0, "motion.toml\n")
    assert call("run", "motion.toml")[0] == 0
    code, _, err = call("kernels", "foliot_motion", "--study", "motion.toml")
    assert (code, "is there already" in err) == (2, True)
    assert call("kernels", "--study", "x.toml")[0] == 2


def test_a_kernel_in_the_current_folder_is_described_as_it_is_run(here, call, monkeypatch):
    """Its module is not on the path of Python: the installed command has its own folder there, not the current one."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    Path("beside_me.py").write_text("from toy import KERNEL\n")
    name = "beside_me:KERNEL"
    code, out, err = call("kernels", name, "--allow-import")
    assert (code, err) == (0, "")
    assert "fall_time" in out
    Path("deep").mkdir()
    Path("deep/below.py").write_text("from toy import KERNEL\n")
    assert call("kernels", "below:KERNEL", "--allow-import", "--study", "deep/below.toml")[0] == 0
    assert call("plan", "deep/below.toml", "--allow-import", "--no-isolate")[0] == 0


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no folder in which nobody may write")
def test_an_output_that_cannot_be_written_is_named_itself(done, call):
    """And not the log, the lock or the folder beside it, of which the user has never heard."""
    fits = ("--y", "fall_time", "--tolerance", "0.1", "--allow-import", "--no-isolate")
    Path("one.toml").write_text(STUDY.replace("[0.0, 1.0, -1.0, nan]", "[0.0, 1.0]"))
    assert call("run", "one.toml", "--allow-import")[0] == 0
    for argv in (("run", "one.toml", "--allow-import"), ("refine", "one.h5", *fits)):
        code, _, err = call(*argv, "-o", "/proc/x.h5")
        assert code == 2
        assert re.match(r"/proc/x\.h5\b(?!\.)", err), err
    with pytest.raises(sweep.SweepError, match=r"^/proc/x\.h5\b(?!\.)"):
        sweep.run("one.toml", "/proc/x.h5", allow_import=True)


def test_tables_have_80_columns(done, call, monkeypatch):
    """Of results whose names, questions and statuses are long."""
    monkeypatch.setenv("COLUMNS", "80")
    title = "Falling stones of all heights, thrown up and down, or not at all, on a planet without an atmosphere"
    long = STUDY.replace("Falling stones", title).replace("# How fast", f"# {title}: how fast")
    Path("long.toml").write_text(long)
    assert call("run", "long.toml", "--allow-import", "-o", "a_result_with_a_long_name.h5")[0] == 0
    trial = ("--allow-import", "--no-isolate")
    chart = ("chart", "stones.toml", *trial, "--cells", "4", "--rtol", "1e-3")
    fit = ("fit", "stones.h5", "--y", "fall_time", "--x", "height", "--at", "v0=0")
    looks = [("list",), ("kernels",), ("kernels", "polisher"), ("studies",), ("show", "a_result_with_a_long_name.h5")]
    trials = [("diff", "stones.h5", "a_result_with_a_long_name.h5"), chart, ("plan", "long.toml", *trial)]
    for command in (*looks, *trials, fit, (*fit, "--compare")):
        code, out, err = call(*command)
        assert code == 0, err
        assert max(map(len, out.splitlines())) <= 80, out
    for command, column in ((("list",), "version"), (chart, "worst cell")):
        assert column in call(*command, "--all")[1]
