"""Files that are damaged at random, and what they are of; shared by tests and the soak scripts."""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path

import h5py
import numpy as np
import xxhash

HERE = Path(__file__)
PATHS = (str(HERE.parent), str(HERE.parents[2]), str(HERE.parents[2] / "tests" / "helpers"))
sys.path[:0] = [p for p in PATHS if p not in sys.path]

import sweep  # noqa: E402
from sweep.errors import SweepError  # noqa: E402
from sweep.file.reading import StoredFile  # noqa: E402
from sweep.file.store import Store, unfinished_of  # noqa: E402
from sweep.file.verify import verify  # noqa: E402
from sweep.runs.run import complete  # noqa: E402

CELLS = 3000


def study(cells=CELLS, every=1, speeds=(0.0, 1.0, -1.0), **keys):
    """A stone thrown from many heights, its way traced."""
    axes = {"height": np.linspace(1.0, 50.0, cells // 3)[::every], "v0": list(speeds)}
    keys = {"outputs": ["fall_time", "drop"], "along": {"phase": [0.0, 0.5]}, **keys}
    return sweep.study(kernel="toy:KERNEL", allow_import=True, axes=axes, **keys)


STUDY = study()


def numbers(path):
    """Digest of all that HDF5 finds in a finished result but the times, and what hangs on the blocks."""
    state = xxhash.xxh3_128()
    with h5py.File(path, "r") as file:
        for name in sorted(name for name in file if isinstance(file[name], h5py.Dataset)):
            values = file[name][()]
            words = values.dtype == object
            state.update(name.encode() + (repr(values.tolist()).encode() if words else values.tobytes()))
    return state.hexdigest()


def unfinished(output):
    """Stops the study when all is computed, and not ended."""
    real = Store.finish
    Store.finish = _stop
    try:
        complete(STUDY, output, workers=1, block_cells=300, progress=False)
    except SweepError:
        return unfinished_of(output)
    finally:
        Store.finish = real


def _stop(*rest):
    raise SweepError("stopped")


RARE = ("cut", "empty", "longer", "swapped", "swapped whole", "strange", "missing")
DAMAGES = ("flip",) * 12 + ("zeroed",) * 8 + RARE


def damage(rng, path, strange):
    """Damages a result, finished or not, in some way; `strange` is one of another study. Tells what it did."""
    kind, content = rng.choice(DAMAGES), bytearray(path.read_bytes())
    with StoredFile(path) as file:
        table, endings = file.layout.work, file.layout.endings
        finished = file.finished
    block, other = rng.sample(range(table.blocks.count), 2)
    place = rng.choice(table.places)
    chunk = slice(place.at(block), place.at(block) + table.stored(place, block))
    if kind in ("flip", "zeroed"):
        length = 1 if kind == "flip" else 512
        at = rng.randrange(len(content) - length)
        if not finished and any(begin - length < at < end for begin, end in endings):
            return damage(rng, path, strange)  # what is written over at the end
        content[at : at + length] = bytes(length) if kind == "zeroed" else [content[at] ^ 1 << rng.randrange(8)]
    elif kind in ("cut", "empty", "missing"):
        content = content[: rng.randrange(len(content)) if kind == "cut" else 0]
    elif kind == "longer":
        content += rng.randbytes(100)
    else:
        rows = [slice(table.digests + b * table.row_bytes, table.digests + (b + 1) * table.row_bytes)
                for b in (block, other)]  # fmt: skip
        if kind == "swapped":
            there = slice(place.at(other), place.at(other) + table.stored(place, other))
            content[chunk], content[there] = content[there], content[chunk]
        elif kind == "swapped whole":
            for p in table.places:
                one, two = (slice(p.at(b), p.at(b) + table.stored(p, b)) for b in (block, other))
                content[one], content[two] = content[two], content[one]
            content[rows[0]], content[rows[1]] = content[rows[1]], content[rows[0]]
        else:
            for at in [*(slice(p.at(block), p.at(block) + table.stored(p, block)) for p in table.places), rows[0]]:
                content[at] = strange[at]
    path.unlink() if kind == "missing" else path.write_bytes(content)
    return kind


def damaged_unfinished(rng, path, strange, scratch, whole):
    """Damages a copy of an unfinished result; what kind, and what went wrong: "" where nothing did."""
    output = scratch / "out.h5"
    shutil.copy(path, unfinished_of(output))
    sound, log = verify(output).findings, io.StringIO()
    kind = damage(rng, unfinished_of(output), strange)
    wrong = []
    if kind != "missing" and unfinished_of(output).read_bytes() != path.read_bytes():
        wrong += ["not found"] if verify(output).findings == sound else []
    try:
        complete(STUDY, output, workers=1, progress=log)
    except SweepError as fault:
        wrong += [] if "give it up with --force" in str(fault) else [f"told: {fault}"]
        complete(STUDY, output, workers=1, progress=log, force=True)
    wrong += [] if numbers(output) == whole else ["other numbers"]
    wrong += ["something is left"] if list(scratch.iterdir()) != [output] else []
    output.unlink()
    return kind, "; ".join(wrong)


def damaged_result(rng, result, strange, scratch, whole):
    """Damages a copy of a finished result, and repairs it; what kind, and what went wrong: "" where nothing did."""
    output = scratch / "out.h5"
    shutil.copy(result, output)
    kind, wrong = damage(rng, output, strange), []
    if kind != "missing" and output.read_bytes() != result.read_bytes():
        found = verify(output)
        wrong += ["not found"] if found.whole else []
        if found.blocks is not None:
            complete(STUDY, output, workers=1, progress=False, repair=True)
            wrong += [] if numbers(output) == whole and verify(output).whole else ["not repaired"]
    output.unlink(missing_ok=True)
    return kind, "; ".join(wrong)


def flip(rng, path):
    """Flips a bit; returns its place."""
    content = bytearray(path.read_bytes())
    place = rng.randrange(len(content))
    content[place] ^= 1 << rng.randrange(8)
    path.write_bytes(content)
    return place
