"""A disk that is too small, or that something else fills meanwhile: a file system of its own in memory."""

import contextlib
import os
import shutil
import subprocess

import numpy as np
import pytest
from running import kept, quiet, same

import sweep
from sweep.cli import main
from sweep.errors import COMPLETE, MISTAKE
from sweep.file.open import open_result, verify
from sweep.file.store import Store, unfinished_of
from sweep.study.read import to_toml

MEGABYTES = 4


@pytest.fixture
def small(tmp_path):
    """A folder on a disk of a few megabytes."""
    folder = tmp_path / "small"
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={MEGABYTES}m", "tmpfs", str(folder)]
    if not shutil.which("mount") or subprocess.run(words, capture_output=True).returncode:
        pytest.skip("this process may not mount a file system")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def fill(folder):
    """Takes all the room that is left, behind the last line of a log too."""
    for path in (folder / "filler", *folder.glob("*.log")):
        with contextlib.suppress(OSError), path.open("ab", buffering=0) as file:
            while True:
                file.write(b"\n" * 4096)
    assert shutil.disk_usage(folder).free == 0


def swept(folder, study, output, *more):
    """Exit status of the command."""
    path = folder / "study.toml"
    path.write_text(to_toml(study), encoding="utf-8")
    words = ["run", path, "-o", output, "--workers", "1", "--allow-import", "--no-isolate", *more]
    return main([str(word) for word in words])


KINDS = {
    "cells": {},
    "summary": {"summary": {"over": ["v0"], "outputs": {"fall_time": ["min", "mean"]}}},
    "trace": {"along": {"phase": [0.0, 0.5, 1.0]}, "outputs": ["fall_time", "drop"]},
}


def falls(heights, **keys):
    axes = {"height": np.arange(1.0, heights + 1), "v0": [0.0, 1.0, 2.0]}
    keys = {"outputs": ["fall_time"], **keys}
    return sweep.study(allow_import=True, kernel="toy:KERNEL", axes=axes, **keys)


@pytest.mark.parametrize("kind", KINDS)
def test_a_disk_that_is_filled_meanwhile_does_not_matter(small, tmp_path, monkeypatch, capsys, kind):
    study, output = falls(500, **KINDS[kind]), small / "out.h5"
    real = Store.put

    def put(self, index, arrays):
        real(self, index, arrays)
        if index == 0:
            fill(small)

    monkeypatch.setattr(Store, "put", put)
    monkeypatch.setattr("sweep.cells.timing.BLOCK_SECONDS", (1e-4, 1e-4))
    assert swept(tmp_path, study, output) == COMPLETE, capsys.readouterr().err
    assert shutil.disk_usage(small).free == 0
    with open_result(output, strict=True) as found:
        same(found, quiet(study))
    assert verify(output).whole


def test_what_was_interrupted_continues_on_a_full_disk(small, monkeypatch):
    study, output = falls(2000), small / "out.h5"
    with monkeypatch.context() as patch:
        real = Store.put
        patch.setattr(Store, "put", lambda self, i, a: real(self, i, a) if i < 7 else os.kill(os.getpid(), 2))
        with pytest.raises(KeyboardInterrupt):
            quiet(study, output, workers=1, block_cells=300)
    before = kept(output)
    assert before
    fill(small)
    with quiet(study, output) as found:
        same(found, quiet(study))
    assert verify(output).whole


def test_an_extension_without_room_leaves_the_result_as_it_was(small, tmp_path, capsys):
    output = small / "out.h5"
    quiet(falls(1000), output).close()
    content = output.read_bytes()
    fill(small)
    assert swept(tmp_path, falls(2000), output, "--extend") == MISTAKE
    assert "only 0 B are free here" in " ".join(capsys.readouterr().err.split())
    assert output.read_bytes() == content
    assert not unfinished_of(output).exists()


@pytest.mark.parametrize("name", ["out.csv", "out.nc", "out.zarr", "out.html", "out.png"])
def test_what_is_made_of_a_result_tells_of_a_full_disk_and_leaves_nothing(small, capsys, name):
    output, target = small / "out.h5", small / name
    quiet(falls(2000), output).close()
    fill(small)
    command = {".html": "report", ".png": "plot"}.get(target.suffix, "export")
    assert main([command, str(output), "-o", str(target)]) == MISTAKE
    told = " ".join(capsys.readouterr().err.split())
    assert "No space left on device" in told or "disk is full" in told
    assert sorted(path.name for path in small.iterdir()) == ["filler", "out.h5"]


@pytest.mark.parametrize("words", [["kernels", "foliot", "--study", "new.toml"], ["studies", "foliot_scaling"]])
def test_a_study_to_begin_with_leaves_nothing_on_a_full_disk(small, monkeypatch, words):
    monkeypatch.chdir(small)
    fill(small)
    assert main(words) == MISTAKE
    assert [path.name for path in small.iterdir()] == ["filler"]
