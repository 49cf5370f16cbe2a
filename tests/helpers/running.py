"""Studies of the toy kernel, run, interrupted, broken and compared."""

import math
import os
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import strategies as st

import sweep
from sweep.errors import SweepError
from sweep.file.reading import StoredFile
from sweep.file.store import Store, unfinished_of
from sweep.runs.run import run

HEIGHTS = [-1.0, 1.0, 2.0, 5.0, float("nan"), 13.5, 100.0]


SPEEDS = [0.0, 0.5, 3.0, 1e-9, 1e4]


def stone(kernel="toy:KERNEL", **keys):
    keys = {"axes": {"height": HEIGHTS, "v0": SPEEDS}, "along": {"phase": [0.0, 0.25, 1.0]}, **keys}
    return sweep.study(allow_import=True, kernel=kernel, title="A stone", **keys)


def tall(count, kernel="toy:KERNEL"):
    """As many cells, of height 1, 2, 3 ... m."""
    return stone(kernel, axes={"height": np.arange(1.0, count + 1)}, outputs=["fall_time"], along={})


def same(left, right):
    """Bit for bit, NaN included."""
    assert list(left.data_vars) == list(right.data_vars)
    for name in left.data_vars:
        assert left[name].dims == right[name].dims
        assert left[name].values.tobytes() == right[name].values.tobytes(), name
        assert left[name].attrs.get("units") == right[name].attrs.get("units")
    for name in left.coords:
        xr.testing.assert_identical(left[name].drop_attrs(), right[name].drop_attrs())


def quiet(study, path=None, **keys):
    return run(study, path, **{"progress": False, "workers": 2, **keys})


def interrupted(study, output):
    """Computes blocks of a study, of about five cells each, and fails at the third."""
    real = Store.put

    def failing(self, index, arrays):
        if index == 2:
            raise RuntimeError("stop here")
        real(self, index, arrays)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Store, "put", failing)
        patch.setattr("sweep.runs.loop.from_everywhere", list)
        with pytest.raises(SweepError, match="stop here"):
            quiet(study, output, block_cells=5, workers=1)


def kept(output):
    """Blocks of an unfinished result that are acknowledged."""
    if not unfinished_of(output).exists():
        return []
    with StoredFile(unfinished_of(output)) as file:
        return np.flatnonzero(file.work.done).tolist()


def place(output, name, cell, table="cells"):
    """Where a cell of a column stands in a file."""
    with StoredFile(output) as file:
        column = file.tables[table].columns[name]
        blocks = column.table.blocks
        block = next(number for number in range(blocks.count) if cell < blocks.bounds(number)[1])
        start = blocks.bounds(block)[0]
        return int(column.at[block]) + (cell - start) * column.size // math.prod(column.table.box)


def environment():
    root = Path(__file__).parents[2]
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(root), str(root / "tests" / "helpers")])}


RUN_SLOWLY = """
    import sys
    from sweep.runs.run import run
    import sweep
    study = sweep.study(allow_import=True, kernel="slow:SLOW", title="A stone", outputs=["fall_time"],
                        axes=dict(height=[float(h) for h in range(1, 401)]))
    run(study, sys.argv[1], workers=int(sys.argv[2]), block_cells=int(sys.argv[3]))
"""


def slow_run(output, workers, cells):
    words = [sys.executable, "-c", textwrap.dedent(RUN_SLOWLY), str(output), str(workers), str(cells)]
    return subprocess.Popen(words, env=environment(), stderr=subprocess.PIPE, text=True)


def wait_for(condition, process):
    deadline = time.monotonic() + 300
    while not condition():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < deadline
        time.sleep(0.002)


def keys(size):
    """Whatever xarray may be asked for along a dimension."""
    ends = st.integers(-size, size)
    slices = st.builds(slice, st.none() | ends, st.none() | ends, st.none() | st.sampled_from([1, 1, 1, 2]))
    return (
        slices
        | st.just(slice(None, None, -1))
        | st.integers(-size, size - 1)
        | st.lists(st.integers(0, size - 1), max_size=4)
    )


def flip(path, place, bit=0):
    """Changes one bit of a file."""
    with path.open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ (1 << bit)]))
