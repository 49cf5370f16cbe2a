"""Studies of the toy kernel, from text; commands, here and in a process of their own."""

import subprocess
import sys

import pytest
from running import environment
from toy_studies import HEAD, STONES

import sweep
from sweep import cli


@pytest.fixture
def read(tmp_path):
    """Reads a study from text; `head` goes before it."""

    def read(text, head=HEAD, allow_import=True):
        path = tmp_path / "fall.toml"
        path.write_text(head + text, encoding="utf-8")
        return sweep.study(path, allow_import=allow_import)

    return read


@pytest.fixture
def mistakes(read):
    """What a study is told: {where: message}."""

    def mistakes(text, **options):
        with pytest.raises(sweep.StudyError) as caught:
            read(text, **options)
        return {m.where: m.message for m in caught.value.mistakes}

    return mistakes


@pytest.fixture
def call(capsys):
    """Runs a command: exit status, what it printed, what it complained of."""

    def call(*argv):
        code = cli.main([str(word) for word in argv])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return call


@pytest.fixture
def begun(tmp_path):
    """Begins a run of stones by the command: the process, and its output."""
    processes = []

    def begin(kernel, count, *options, **environ):
        (tmp_path / "stones.toml").write_text(STONES.format(kernel=kernel, count=count))
        words = [sys.executable, "-m", "sweep", "run", "stones.toml", "--allow-import", *options]
        keys = {"env": {**environment(), **environ}, "cwd": tmp_path, "stderr": subprocess.PIPE, "text": True}
        processes.append(subprocess.Popen(words, start_new_session=True, **keys))
        return processes[-1], tmp_path / "stones.h5"

    yield begin
    for process in processes:
        process.kill()
        process.communicate()


@pytest.fixture(autouse=True)
def _width(monkeypatch):
    """Texts are wrapped at 120 columns, whatever terminal the tests run in."""
    monkeypatch.setenv("COLUMNS", "120")
