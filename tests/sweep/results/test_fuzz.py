"""Files that nobody vouches for: no traceback, no hang, no foreign code, no path out of its folder."""

import contextlib
import os
import pickle
import random
import shutil

import h5py
import numpy as np
import pytest
from fuzzing import fuzz_result, fuzz_study, prepared, quietly
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from running import quiet, tall

import sweep
from sweep.cli import main
from sweep.errors import StudyError, SweepError

SHARED = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]


@settings(max_examples=200, deadline=None, suppress_health_check=SHARED)
@given(seed=st.integers(0, 2**63))
def test_a_study_of_nonsense_is_read_or_refused(tmp_path, seed):
    assert fuzz_study(random.Random(seed), tmp_path) in ("read", "refused")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return prepared(tmp_path_factory.mktemp("whole"))


def test_commands_on_a_damaged_result_end_with_a_message(whole, tmp_path):
    for seed in range(5):
        assert set(fuzz_result(random.Random(seed), whole, tmp_path)) <= {0, 2}, seed


def test_a_heap_in_which_hdf5_would_loop_for_ever_is_not_shown_to_it(whole, tmp_path):
    """HDF5 2.0 comes to no end with zeros in its heap of references."""
    path, content = tmp_path / "out.h5", bytearray(whole.read_bytes())
    at = content.index(b"GCOL") + 16
    content[at : at + 512] = bytes(512)
    path.write_bytes(content)
    with sweep.open_result(path) as found, sweep.open_result(whole) as sound:
        assert found.identical(sound)
    assert not sweep.verify(path).whole


def external_storage(file, secret):
    del file["fall_time"]
    file.create_dataset("fall_time", (100, 3), "f8", external=[(str(secret), 0, h5py.h5f.UNLIMITED)])


def virtual(file, secret):
    del file["fall_time"]
    layout = h5py.VirtualLayout((100, 3), "f8")
    layout[...] = h5py.VirtualSource(str(secret), "x", (100, 3))
    file.create_virtual_dataset("fall_time", layout)


def external_link(file, secret):
    del file["status"]
    file["status"] = h5py.ExternalLink(str(secret), "/")


def group_elsewhere(file, secret):
    del file["integrity"]
    file["integrity"] = h5py.ExternalLink(str(secret), "/")


@pytest.mark.parametrize("lead_away", [external_storage, virtual, external_link, group_elsewhere])
def test_a_result_leads_to_no_other_file(whole, tmp_path, lead_away):
    secret = tmp_path / "secret"
    os.mkfifo(secret)  # who opened it would wait for ever
    path = shutil.copy(whole, tmp_path / "out.h5")
    with h5py.File(path, "r+") as file:
        lead_away(file, secret)
    with pytest.raises(SweepError, match="damaged"):
        sweep.open_result(path)


def one_column_more(file):
    """Over the axis, as any program may add one."""
    file["more"] = np.zeros(len(file["height"]))
    file["more"].dims[0].attach_scale(file["height"])


def of_absurd_size(file):
    """No memory has room for it."""
    del file["fall_time"]
    file.create_dataset("fall_time", (1 << 44,), "f8", chunks=(1 << 20,))


def without_dimension(file):
    """The cells' statuses."""
    del file["status"]
    file["status"] = np.int8(0)


def of_another_shape(file):
    """With the attributes that it had; HDF5 2.0 crashes when h5netcdf looks at its dimensions."""
    attrs = dict(file["method_used"].attrs)
    del file["method_used"]
    made = file.create_dataset("method_used", (1,), "u8")
    for name, value in attrs.items():
        with contextlib.suppress(TypeError, ValueError, OSError, RuntimeError):
            made.attrs[name] = value


def short_chunk(file):
    """Of fewer bytes than it says."""
    file["fall_time"].id.write_direct_chunk((0, 0), bytes(40))


def with_attribute(place, name, value):
    """Of another kind than it was."""
    return lambda file: file[place].attrs.create(name, value)


CHANGES = [
    (one_column_more, 0),
    (of_absurd_size, 2),
    (without_dimension, 2),
    (of_another_shape, 2),
    (short_chunk, 2),
    (with_attribute("/", "end", np.zeros(3)), 0),
    (with_attribute("height", "units", 5), 0),
    (with_attribute("status", "flag_meanings", 3.0), 0),
]


@pytest.mark.parametrize(("change", "status"), CHANGES)
def test_a_result_that_another_program_changed_is_shown_or_refused(whole, tmp_path, capsys, change, status):
    path = shutil.copy(whole, tmp_path / "out.h5")
    with h5py.File(path, "r+") as file:
        change(file)
    assert main(["show", str(path)]) == status
    error = capsys.readouterr().err
    assert bool(error) is bool(status)
    assert "Traceback" not in error


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
    for name in ("loads", "load", "Unpickler"):
        monkeypatch.setattr(pickle, name, None)
    with sweep.open_result(whole) as found:
        found.load()
    assert sweep.verify(whole).whole
    quiet(tall(30), tmp_path / "out.h5", block_cells=10).close()
