"""Whether HDF5 is let loose on a file: what another process says of it, how long it is waited for, and what is kept."""

import os

import h5py
import numpy as np
import pytest
from handmade import harm, written

from sweep.store import probe
from sweep.store.probe import check_own, intact, probing, readable


@pytest.fixture
def path(tmp_path):
    written(tmp_path / "out.h5")
    return tmp_path / "out.h5"


@pytest.fixture
def counted(monkeypatch):
    """A process that looks at nothing, and ends with what stands in `code`; how often it is started."""
    started, real = [], probe.subprocess.Popen
    monkeypatch.setattr(probe.subprocess, "Popen", lambda words, **keys: started.append(words) or real(words, **keys))
    monkeypatch.setattr(probe, "PROBE", "import os; os._exit(0)")
    monkeypatch.setattr(probe, "_written", set())
    return started


def test_a_file_is_intact_when_its_trailer_says_so(path, tmp_path, monkeypatch):
    assert intact(path)
    harm(path, 100)
    assert not intact(path)
    harm(path, 100)
    assert not intact(tmp_path)
    assert not intact(tmp_path / "none")
    monkeypatch.setattr(probe, "MOST_AT_ONCE", 10)
    assert not intact(path)

    def refused(*args):
        raise OSError

    monkeypatch.setattr(probe, "unbroken", refused)
    assert not intact(path)


def test_a_file_that_was_read_once_is_not_read_again_until_it_is_changed(path, counted):
    assert [probing(path)(), probing(path)()] == [True, True]
    assert len(counted) == 1
    assert counted[0][-1] == str(path)
    harm(path, 100)
    assert probing(path)()
    assert len(counted) == 2
    probe.written(path)
    probing(path)()
    assert len(counted) == 2


@pytest.mark.parametrize("end", ["os._exit(1)", "os.kill(os.getpid(), 9)"])
def test_what_could_not_be_read_is_asked_for_again(path, counted, monkeypatch, end):
    monkeypatch.setattr(probe, "PROBE", f"import os; {end}")
    assert [probing(path)(), probing(path)()] == [False, False]
    assert len(counted) == 2


@pytest.mark.parametrize(("seconds", "speed", "found"), [(0.0, 1e12, False), (60.0, 1e12, True), (0.0, 30_000.0, True)])
def test_a_process_is_waited_for_as_long_as_the_file_is(path, counted, monkeypatch, seconds, speed, found):
    """Its about 20 000 bytes are worth nothing, or most of a second."""
    monkeypatch.setattr(probe, "PROBE", "import time; time.sleep(0.1)")
    monkeypatch.setattr(probe, "PROBE_SECONDS", seconds)
    monkeypatch.setattr(probe, "PROBE_SPEED", speed)
    assert probing(path)() is found


def test_only_what_its_trailer_does_not_vouch_for_is_read_by_another_process(path, counted):
    with path.open("rb") as file:
        assert readable(path, file.fileno())
    assert counted == []
    harm(path, 100)
    with path.open("rb") as file:
        assert readable(path, file.fileno())
    assert len(counted) == 1


def test_the_process_reads_what_there_is(path, tmp_path, monkeypatch):
    monkeypatch.setattr(probe, "_written", set())
    bad = tmp_path / "bad.h5"
    bad.write_bytes(b"nothing")
    asked = [probing(path), probing(bad)]
    assert [found() for found in asked] == [True, False]


def linked(name):
    """A file of HDF5 in memory with what must not be in a result; None: what may."""
    file = h5py.File(f"{os.getpid()}.h5", "w", driver="core", backing_store=False)
    file["x"], file["group/y"] = np.arange(3), np.arange(2)
    if name == "soft":
        file["link"] = h5py.SoftLink("/x")
    elif name == "external":
        file["link"] = h5py.ExternalLink("other.h5", "/x")
    elif name == "inner soft":
        file["group/link"] = h5py.SoftLink("/x")
    elif name == "deep":
        file["group/deep/z"] = 1
    elif name == "virtual":
        file.create_virtual_dataset("link", h5py.VirtualLayout((3,), "f8"))
    elif name == "outside":
        file.create_dataset("link", (3,), "f8", external=[("other.bin", 0, 24)])
    elif name == "type":
        file["link"] = np.dtype("f8")
    return file


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("soft", "link is a link"),
        ("external", "link is a link"),
        ("inner soft", "link is a link"),
        ("deep", "deep is not in the file itself"),
        ("virtual", "link is not in the file itself"),
        ("outside", "link is not in the file itself"),
        ("type", "link is not in the file itself"),
    ],
)
def test_what_lies_elsewhere_is_refused(name, text):
    with linked(name) as file, pytest.raises(ValueError, match=f"^{text}$"):
        check_own(file)


def test_datasets_and_groups_of_datasets_are_own():
    with linked(None) as file:
        assert check_own(file) is None
