"""Files that nobody vouches for: no traceback, no hang, no foreign code, no path out of its folder."""

import contextlib
import dataclasses
import os
import pickle
import random
import time

import h5py
import numpy as np
import pytest
from fuzzing import STUDY, forge, fuzz_result, fuzz_study, prepared, quietly
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from running import quiet, tall

import sweep
from sweep.cells.partition import Partition
from sweep.cli import main
from sweep.results.verify import verify
from sweep.store import probe
from sweep.store.layout import read_layout, structure_digest
from sweep.system.errors import StudyError, SweepError

SHARED = [HealthCheck.function_scoped_fixture]


@settings(max_examples=200, deadline=2000, suppress_health_check=SHARED)
@given(seed=st.integers(0, 2**63))
def test_a_study_of_nonsense_is_read_or_refused(tmp_path, seed):
    assert fuzz_study(random.Random(seed), tmp_path) in ("read", "refused")


@settings(max_examples=100, deadline=2000, suppress_health_check=SHARED)
@given(content=st.binary(max_size=300) | st.text(max_size=300).map(lambda text: text.encode("utf-8", "replace")))
def test_any_bytes_as_a_study_are_refused(tmp_path, content):
    path = tmp_path / "study.toml"
    path.write_bytes(content)
    with pytest.raises(SweepError):
        sweep.study(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return prepared(tmp_path_factory.mktemp("whole"))


def test_commands_on_a_damaged_result_end_with_a_message(whole, tmp_path):
    for seed in range(5):
        assert set(fuzz_result(random.Random(seed), whole, tmp_path)) <= {0, 2}, seed


def test_a_file_that_hdf5_cannot_come_to_an_end_with_is_given_up(whole, tmp_path, monkeypatch):
    """HDF5 2.0 loops for ever in some damaged files; the process that tries them first takes the blow."""
    monkeypatch.setattr(probe, "PROBE", "while True: pass")
    monkeypatch.setattr(probe, "PROBE_SECONDS", 0.3)
    path = tmp_path / "out.h5"
    path.write_bytes(whole.read_bytes() + b"x")
    begun = time.monotonic()
    with pytest.raises(SweepError, match="damaged"):
        sweep.open_result(path)
    assert not verify(path).whole
    assert time.monotonic() - begun < 20


COMMANDS = {
    "show": (), "verify": (), "plot": (), "report": (), "export": ("-o", "out.csv"),
    "fit": ("--y", "fall_time", "--x", "height"),
    "refine": ("--y", "fall_time", "--tolerance", "0.1", "-o", "fine.h5", "--allow-import"),
}  # fmt: skip


def forged(whole, path):
    """A result that has another byte, and a seal as if it always had."""
    content = bytearray(whole.read_bytes())
    content[content.index(b"Stone" if b"Stone" in content else b"toy:KERNEL")] ^= 1
    path.write_bytes(content)
    forge(path)
    assert probe.intact(path)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_forged_seal_does_not_make_a_command_hang(whole, tmp_path, monkeypatch, capfd, command):
    monkeypatch.chdir(tmp_path)
    forged(whole, tmp_path / "out.h5")
    monkeypatch.setattr(probe, "PROBE", "while True: pass")
    monkeypatch.setattr(probe, "PROBE_SECONDS", 0.3)
    monkeypatch.setattr("h5py.File", lambda *args: pytest.fail("opened here"))
    assert main([command, "out.h5", *COMMANDS[command]]) == 2
    assert "not the result of a sweep, or damaged" in capfd.readouterr().err


def lead_away(file, kind, secret):
    """Makes what a result holds lie in another file."""
    if kind == "soft link":
        file["other"] = h5py.SoftLink("/status")
    elif kind == "external link":
        file["other"] = h5py.ExternalLink(str(secret), "/")
    elif kind == "external storage":
        del file["fall_time"]
        file.create_dataset("fall_time", (100, 3), "f8", external=[(str(secret), 0, h5py.h5f.UNLIMITED)])
    elif kind == "virtual":
        source = h5py.VirtualSource(str(secret), "x", (100, 3))
        del file["fall_time"]
        layout = h5py.VirtualLayout((100, 3), "f8")
        layout[...] = source
        file.create_virtual_dataset("fall_time", layout)
    else:
        file["integrity/round"] = file["integrity"]


def seal(path, layout):
    """Puts a right trailer behind a file that h5py has changed."""
    with path.open("r+b") as file:
        end = file.seek(0, 2)
        structure = structure_digest(file.fileno(), layout.endings, end)
        file.write(dataclasses.replace(layout, regions=(), end=end, structure=structure).trailer())
    assert probe.intact(path)


@pytest.mark.parametrize("sealed", [False, True])
@pytest.mark.parametrize("kind", ["soft link", "external link", "external storage", "virtual", "round"])
def test_a_result_leads_to_no_other_file(whole, tmp_path, kind, sealed):
    secret = tmp_path / "secret"
    os.mkfifo(secret)  # who opened it would wait for ever
    path = tmp_path / "out.h5"
    path.write_bytes(whole.read_bytes())
    with path.open("r+b") as file:
        layout = read_layout(file.fileno(), path.stat().st_size)
        file.truncate(layout.end)
    with h5py.File(path, "r+") as file:
        lead_away(file, kind, secret)
    if sealed:
        seal(path, layout)
    with pytest.raises(SweepError, match="not the result of a sweep, or damaged"):
        sweep.open_result(path)
    assert not verify(path).whole


@pytest.mark.parametrize("command", ["show", "verify"])
def test_a_layout_of_more_blocks_than_the_file_has_room_for_is_none(whole, tmp_path, capsys, command):
    path, count = tmp_path / "out.h5", 2**40
    path.write_bytes(whole.read_bytes())
    with path.open("r+b") as file:
        layout = read_layout(file.fileno(), path.stat().st_size)
        table = dataclasses.replace(layout.work, grid=(count,), blocks=Partition(count, 1))
        file.truncate(layout.end)
        file.seek(layout.end)
        file.write(dataclasses.replace(layout, tables={"cells": table}).trailer())
    assert main([command, str(path)]) == 2
    assert "memory" not in capsys.readouterr().err


def test_a_result_that_was_changed_on_purpose_can_still_be_opened(whole, tmp_path):
    path = tmp_path / "out.h5"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["comment"] = "mine"
    with sweep.open_result(path) as found:
        assert found.attrs["comment"] == "mine"
    assert not verify(path).whole


ODD = [("/", "rtol", "x"), ("/", "rtol", np.arange(5.0)), ("/", "end", np.zeros(3)), ("/", "cells_per_second", "x"),
       ("/", "title", 1.0), ("height", "units", 5), ("status", "flag_meanings", 3.0)]  # fmt: skip


@pytest.mark.parametrize(("place", "name", "value"), ODD)
def test_an_attribute_of_another_kind_is_damage(whole, tmp_path, capsys, place, name, value):
    path = tmp_path / "out.h5"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        file[place].attrs[name] = value
    assert main(["show", str(path)]) == 2
    assert "not the result of a sweep, or damaged" in capsys.readouterr().err


def no_dimension(file):
    """Of the cells' statuses."""
    del file["status"]
    file["status"] = np.int8(0)


def one_column_more(file):
    """Over the axis, as any program may add one."""
    file["more"] = np.zeros(len(file["height"]))
    file["more"].dims[0].attach_scale(file["height"])


def one_thing_more(file):
    """Zeros that HDF5 makes of a few bytes, over no dimension: h5netcdf would take the axis to be over them too."""
    file.create_dataset("more", (10**7,), "f8", chunks=(10**6,), compression="gzip")[...] = 0.0


def twice(file):
    """A value of an axis stands there twice."""
    file["height"][1] = file["height"][0]


def no_text(file):
    """Bytes that are no UTF-8."""
    file.attrs.create("title", b"\xc4", dtype=h5py.string_dtype())


def no_word(file):
    """In the study."""
    file.attrs["study_json"] = file.attrs["study_json"].replace('"method":"auto"', '"method":{}')


def another_shape(file):
    """With the attributes that it had; HDF5 2.0 crashes when h5netcdf looks at its dimensions."""
    attrs = dict(file["method_used"].attrs)
    del file["method_used"]
    made = file.create_dataset("method_used", (1,), "u8")
    for name, value in attrs.items():
        with contextlib.suppress(TypeError, ValueError, OSError, RuntimeError):
            made.attrs[name] = value


DAMAGED, CHANGED = "not the result of a sweep, or damaged", "was changed by another program, and is no result any more"
FORGED = [(no_dimension, CHANGED), (one_column_more, ""), (one_thing_more, DAMAGED), (twice, ""),
          (no_text, DAMAGED), (no_word, ""), (another_shape, DAMAGED)]  # fmt: skip


@pytest.mark.parametrize(("change", "told"), FORGED)
@pytest.mark.parametrize("sealed", [False, True])
def test_a_result_holds_what_its_study_says(whole, tmp_path, capsys, change, told, sealed):
    path = tmp_path / "out.h5"
    path.write_bytes(whole.read_bytes())
    with path.open("r+b") as file:
        layout = read_layout(file.fileno(), path.stat().st_size)
        file.truncate(layout.end)
    with h5py.File(path, "r+") as file:
        change(file)
    if sealed:
        seal(path, layout)
    expected = DAMAGED if sealed and change is not no_word else told
    command = ["report", str(path), "-o", str(tmp_path / "out.html")] if change is no_text else ["show", str(path)]
    status, said = main(command), capsys.readouterr().err
    if change is no_word and sealed:
        assert "not the JSON of a study" in said
    assert expected in said
    assert status == (2 if sealed or expected else 0)


@pytest.mark.parametrize("name", ["../secret.csv", "/etc/passwd", "sub/../../secret.csv", "link.csv", "\0", "a" * 5000])
def test_a_study_names_no_file_outside_of_its_folder(tmp_path, name):
    (tmp_path / "secret.csv").write_text("height\n1\n2\n")
    folder = tmp_path / "study"
    (folder / "sub").mkdir(parents=True)
    (folder / "link.csv").symlink_to(tmp_path / "secret.csv")
    text = name.replace("\0", "\\u0000")
    (folder / "study.toml").write_text(f'kernel = "toy:KERNEL"\noutputs = ["fall_time"]\naxes.height.file = "{text}"\n')
    with pytest.raises(StudyError) as told:
        sweep.study(folder / "study.toml", allow_import=True)
    assert [m.where for m in told.value.mistakes] == ["axes.height.file"]


@pytest.mark.parametrize("command", ["run", "plan"])
def test_foreign_code_runs_only_where_it_is_allowed(tmp_path, command):
    (tmp_path / "evil.py").write_text("raise SystemExit('run')\n")
    path = tmp_path / "study.toml"
    path.write_text('kernel = "evil:KERNEL"\naxes.height = [1.0]\n')
    assert quietly(command, path) == 2


def test_no_result_or_part_is_unpickled(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(pickle, "loads", None)
    monkeypatch.setattr(pickle, "load", None)
    monkeypatch.setattr(pickle, "Unpickler", None)
    with sweep.open_result(whole) as found:
        found.load()
    assert verify(whole).whole
    quiet(tall(30), tmp_path / "out.h5", block_cells=10).close()


def test_the_study_that_nonsense_is_made_of_is_a_sound_one(read):
    assert read(STUDY, head="").kernel_name == "toy:KERNEL"
