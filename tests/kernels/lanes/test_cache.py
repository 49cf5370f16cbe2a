"""Machine code on the disk: never stale, never in the way."""

import json
import os
import pickle
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from loops import each_cell, entry
from numba import float64
from numba.core.errors import TypingError

from kernels.catalogue import KERNELS
from kernels.lanes.cache import FOLDER
from kernels.lanes.jit import COMPILED, jit

pytestmark = pytest.mark.skipif(not COMPILED, reason="plain Python has no machine code")

ROOT = Path(__file__).parents[3]
CHECK = """
import numpy as np
from kernels.lanes import cache as _cache
from kernels.foliot.design import FOLIOT_DESIGN
check, status = FOLIOT_DESIGN.check, np.zeros(1, np.int8)
check(*(np.array([value]) for value in FOLIOT_DESIGN.example.values()), status)
print(status[0], sum(check.compiled.stats.cache_hits.values()), _cache.FOLDER)
"""
"""Of the kernel that is loaded and compiled soonest."""
WHERE = "from kernels.lanes import cache; print(cache.FOLDER)"
"""The folder of machine code alone; that all works where there is none is a test of its own."""


def said(code, cache, **more):
    """What a fresh interpreter prints, and what it says on stderr."""
    env = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    env |= {"XDG_CACHE_HOME": str(cache), **more}
    done = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, cwd=more.get("PWD", ROOT)
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split(), done.stderr


def run(code, cache, **more):
    """Status of a good cell, cache hits and folder, in a fresh interpreter."""
    return said(code, cache, **more)[0]


@pytest.fixture(scope="module")
def compiled_once(tmp_path_factory):
    """A folder in which a first process has kept what it compiled; to be copied by who changes it."""
    folder = tmp_path_factory.mktemp("kept")
    assert run(CHECK, folder)[:2] == ["0", "0"]
    return folder


@pytest.fixture
def filled(compiled_once, tmp_path):
    """A copy of it, with the rights of its files."""
    return shutil.copytree(compiled_once, tmp_path, dirs_exist_ok=True)


def test_of_two_processes_at_a_time_one_compiles_and_the_other_waits(tmp_path):
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    words = {"env": env, "cwd": ROOT, "stdout": subprocess.PIPE, "text": True}
    both = [subprocess.Popen([sys.executable, "-c", CHECK], **words) for _ in range(2)]
    assert sorted(process.communicate()[0].split()[:2] for process in both) == [["0", "0"], ["0", "1"]]


def test_functions_have_numbers_that_no_other_process_gives():
    """They are in the names of machine code: of two processes' files one function was taken for another of its name."""
    code = """
import os
from numba.core.bytecode import FunctionIdentity
import kernels.lanes.cache
def number():
    print(FunctionIdentity.from_function(number).unique_id, flush=True)
number()
if os.fork() == 0:
    number()
    os._exit(0)
os.wait()
"""
    numbers = sorted(int(number) for _ in range(2) for number in run(code, ROOT))
    assert min(np.diff(numbers)) > 1e6


def test_a_damaged_cache_is_compiled_again_and_mended(filled):
    for path in filled.rglob("*.nb?"):
        path.write_bytes(path.read_bytes()[:10])
    assert run(CHECK, filled)[:2] == ["0", "0"]
    assert run(CHECK, filled)[:2] == ["0", "1"]


SHARED = """
import sys
sys.path.append("tests/helpers")
import numpy as np
from columns import solve
from numba.core import event
from kernels.drivetrain.reduced import DRIVETRAIN
cells = {name: np.array([value, value]) for name, value in DRIVETRAIN.example.items()} | {"reduction": [0.0, 1.0]}
with event.install_recorder("numba:compile") as recorder:
    outputs, status = solve(DRIVETRAIN, "direct", **cells)
print(*(frequency.hex() for frequency in outputs["frequency"][:, 0]))
print(*(one.data["dispatcher"].py_func.__name__ for _, one in recorder.buffer if one.is_start))
"""
"""Two reductions, which call `natural_frequencies` by its address; what is compiled for them."""


@pytest.mark.skipif(FOLDER is None, reason="no folder for compiled code")
def test_a_function_called_by_its_address_is_compiled_once_and_alone_where_it_is_lost(tmp_path):
    first = run(SHARED, FOLDER.parents[1])
    folder = tmp_path / "foliot" / FOLDER.name
    folder.mkdir(mode=0o700, parents=True)
    kept = [
        path for room in ("wiring.drivetrain.", "reduced.", "_rivin.", "_poles.") for path in FOLDER.glob(f"{room}*")
    ]
    for path in kept:  # neither natural_frequencies nor what other reductions call
        shutil.copy(path, folder)
    again = run(SHARED, tmp_path)
    assert again[:2] == first[:2]
    assert again.count("natural_frequencies") == 1
    assert not {"guyan", "poles_of_chain", "direct"} & {*again}
    assert [*folder.glob("*natural_frequencies*.nbc")]


def test_where_there_can_be_no_cache_it_works_without(tmp_path):
    (tmp_path / "file").write_text("")
    assert run(CHECK, tmp_path / "file")[2] == "None"


def test_an_edited_source_is_compiled_anew_in_the_cache_of_numba_too(tmp_path):
    shutil.copytree(ROOT / "kernels", tmp_path / "kernels")
    place = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PWD": str(tmp_path), "PYTHONPATH": str(tmp_path)}
    status, _, folder = run(CHECK, tmp_path / "other", **place)
    assert (status, Path(folder).parents[1]) == ("0", tmp_path / "cache")
    source = tmp_path / "kernels" / "interface.py"
    source.write_text(source.read_text().replace("OK = 0,", "OK = 5,"))
    assert run(CHECK, tmp_path / "other", **place)[:2] == ["5", "0"]


def test_code_of_other_sources_goes_when_it_was_not_used_for_long(tmp_path):
    old, young, alien = (tmp_path / "foliot" / name for name in ("0" * 20, "1" * 20, "letters"))
    for folder in (old, young, alien):
        folder.mkdir(parents=True, mode=0o700)
    for folder in (old, alien):
        os.utime(folder, (time.time() - 40 * 24 * 3600,) * 2)
    run(WHERE, tmp_path)
    assert not old.exists()
    assert young.exists()
    assert alien.exists()


def test_a_kernel_of_the_users_own_is_not_cached():
    @jit
    def body(i, x, y):
        y[i] = 2.0 * x[i]

    @entry
    def double(x, y):
        each_cell(body, (x, y))

    y = np.empty(40)
    double(np.ones(40), y)
    assert (y == 2.0).all()
    assert double.compiled.stats.cache_path is None
    for wrong in (np.ones(80)[::2], np.ones(40, np.float32), np.ones((40, 1))):
        with pytest.raises(TypingError):
            double(wrong, y)
    assert double.compiled.signatures[0][0].dtype == float64


OWN_SCENE = """
import sys
import threading
sys.path += ["tests/helpers", "studies"]
from columns import solve
from numba.core import event
from own_scene import KERNEL
with event.install_recorder("numba:compile") as recorder:
    _, status = solve(KERNEL, "taylor_once", **{name: [value] for name, value in KERNEL.example.items()})
print(status[0], sum(one.is_start for _, one in recorder.buffer))
"""
"""Prints the status of a cell, and how many functions were compiled."""


@pytest.fixture(scope="module")
def scene_kept(tmp_path_factory):
    """A folder in which a process that lets everybody write has kept a scene of one's own."""
    folder = tmp_path_factory.mktemp("scene")
    before = os.umask(0)
    try:
        status, compiled = run(OWN_SCENE, folder)
    finally:
        os.umask(before)
    assert status == "0"
    assert int(compiled) > 0
    return folder


def test_what_is_written_for_a_scene_of_ones_own_is_compiled_once(scene_kept):
    assert run(OWN_SCENE, scene_kept) == ["0", "0"]


NAMES = [*KERNELS, "rich_scene:RICH"]
"""All kernels, and a scene of one's own of which other tests compile each method."""


@pytest.fixture(scope="module")
def compiled_again():
    """For each kernel what a process compiles, or a second one where the first had to."""
    command = [sys.executable, "-W", "error", ROOT / "tests" / "helpers" / "compiling.py", *NAMES]
    for _ in range(2):
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        if not any(found.values()):
            break
    return found


@pytest.mark.skipif(FOLDER is None, reason="no folder for compiled code")
@pytest.mark.parametrize("name", NAMES)
def test_a_second_process_compiles_nothing_of_any_kernel_and_method(name, compiled_again):
    assert compiled_again[name] == []


@pytest.mark.parametrize(("which", "others"), [("foliot", 0o020), ("foliot/*", 0o002)])
def test_a_folder_that_others_may_write_to_is_not_used(filled, which, others):
    (folder,) = filled.glob(which)
    folder.chmod(0o700 | others)
    used, told = said(WHERE, filled)
    assert used == ["None"]
    assert str(folder) in told
    assert len(told.splitlines()) == 1


def test_a_file_that_others_may_write_to_is_not_read(filled):
    (path,) = filled.rglob("*.nbc")
    path.write_bytes(pickle.dumps(Trap(filled / "sprung")))
    path.chmod(0o620)
    (status, hits, _), told = said(CHECK, filled)
    assert (status, hits) == ("0", "0")
    assert str(path) in told
    assert not (filled / "sprung").exists()
    assert run(CHECK, filled)[:2] == ["0", "1"]


class Trap:
    """Makes a folder where its pickle is read."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
@pytest.mark.parametrize("link", [False, True])
def test_a_folder_of_somebody_else_is_not_used(tmp_path, link):
    if link:
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        (tmp_path / "foliot").symlink_to("elsewhere")
    else:
        (tmp_path / "foliot").mkdir(mode=0o700)
    os.chown(tmp_path / "foliot", 65534, 65534, follow_symlinks=False)
    used, told = said(WHERE, tmp_path)
    assert used == ["None"]
    assert str(tmp_path / "foliot") in told


def test_what_is_kept_is_the_users_alone_whatever_the_umask(scene_kept):
    kept = [scene_kept / "foliot", *(scene_kept / "foliot").rglob("*")]
    assert [path for path in kept if path.suffix == ".nbc"]
    assert not [path for path in kept if path.stat().st_mode & 0o077]
