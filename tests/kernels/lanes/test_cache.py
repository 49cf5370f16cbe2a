"""Machine code on the disk: never stale, never in the way."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numba import float64
from numba.core.errors import TypingError

from kernels.lanes.columns import each_cell, entry
from kernels.lanes.jit import COMPILED, jit

pytestmark = pytest.mark.skipif(not COMPILED, reason="plain Python has no machine code")

ROOT = Path(__file__).parents[3]
PERIOD = """
import numpy as np
from kernels.lanes import cache as _cache
from kernels.foliot import cycle
x = [np.ones(1) for _ in range(9)]
status = np.zeros(1, np.int8)
x[3], x[4] = 0.5 * x[3], 0.5 * x[4]  # R, R_s
cycle.check(*x, status)
print(status[0], sum(cycle.check.compiled.stats.cache_hits.values()), _cache.FOLDER)
"""


def run(code, cache, **more):
    """Status of a good cell, cache hits and folder, in a fresh interpreter."""
    env = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    env |= {"XDG_CACHE_HOME": str(cache), **more}
    done = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, cwd=more.get("PWD", ROOT)
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_second_process_finds_what_the_first_compiled(tmp_path):
    assert run(PERIOD, tmp_path)[:2] == ["0", "0"]
    assert run(PERIOD, tmp_path)[:2] == ["0", "1"]


def test_a_damaged_cache_is_compiled_again_and_mended(tmp_path):
    run(PERIOD, tmp_path)
    for path in tmp_path.rglob("*.nb?"):
        path.write_bytes(path.read_bytes()[:10])
    assert run(PERIOD, tmp_path)[:2] == ["0", "0"]
    assert run(PERIOD, tmp_path)[:2] == ["0", "1"]


def test_where_there_can_be_no_cache_it_works_without(tmp_path):
    (tmp_path / "file").write_text("")
    assert run(PERIOD, tmp_path / "file")[2] == "None"


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "NUMBA_CACHE_DIR"])
def test_an_edited_source_is_compiled_anew_wherever_the_cache_is(tmp_path, variable):
    shutil.copytree(ROOT / "kernels", tmp_path / "kernels")
    place = {variable: str(tmp_path / "cache"), "PWD": str(tmp_path), "PYTHONPATH": str(tmp_path)}
    assert run(PERIOD, tmp_path / "cache", **place)[0] == "0"
    source = tmp_path / "kernels" / "interface.py"
    source.write_text(source.read_text().replace("OK = 0,", "OK = 5,"))
    assert run(PERIOD, tmp_path / "cache", **place)[:2] == ["5", "0"]


def test_code_of_other_sources_goes_when_it_was_not_used_for_long(tmp_path):
    old, young = tmp_path / "foliot" / "old", tmp_path / "foliot" / "young"
    for folder in (old, young):
        folder.mkdir(parents=True)
    os.utime(old, (time.time() - 40 * 24 * 3600,) * 2)
    run(PERIOD, tmp_path)
    assert not old.exists()
    assert young.exists()


def test_a_kernel_of_the_users_own_is_not_cached():
    @jit
    def body(i, x, y):
        y[i] = 2.0 * x[i]

    @entry()
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
sys.path += ["tests/helpers", "studies"]
from columns import solve
from own_scene import KERNEL
_, status = solve(KERNEL, "taylor", **{name: [value] for name, value in KERNEL.example.items()})
written = next(module for name, module in sys.modules.items() if name.startswith("scene_"))
print(status[0], sum(sum(getattr(written, f"run_{order}").stats.cache_hits.values()) for order in (12, 18)))
"""


def test_what_is_written_for_a_scene_of_ones_own_is_compiled_once(tmp_path):
    assert run(OWN_SCENE, tmp_path) == ["0", "0"]
    status, hits = run(OWN_SCENE, tmp_path)
    assert status == "0"
    assert int(hits) > 0
