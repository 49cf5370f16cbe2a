"""Files that are damaged at random, and what they are of; shared by tests and the soak scripts."""

from __future__ import annotations

import io
import itertools
import shutil
import sys
from pathlib import Path

import h5py
import numpy as np
import xarray as xr
import xxhash

HERE = Path(__file__)
PATHS = (str(HERE.parent), str(HERE.parents[2]), str(HERE.parents[2] / "tests" / "helpers"))
sys.path[:0] = [p for p in PATHS if p not in sys.path]

import sweep  # noqa: E402
from sweep.errors import SweepError  # noqa: E402
from sweep.file.open import verify  # noqa: E402
from sweep.file.reading import StoredFile  # noqa: E402
from sweep.file.store import Store, unfinished_of  # noqa: E402
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
        table, ending, finished = file.work, file.tables["ending"], file.finished
        last = [span(ending.columns["ending"], 0), slice(ending.digests_at, ending.digests_at + ending.row_bytes)]
        chunks = [[span(column, block) for column in table.columns.values()] for block in range(table.blocks.count)]
        stands = [slice(0, table.digests_at + table.digests.size), *itertools.chain(*chunks, last)]
    block, other = rng.sample(range(table.blocks.count), 2)
    number = rng.randrange(len(table.columns))
    if kind in ("flip", "zeroed"):
        length = 1 if kind == "flip" else 512
        at = rng.randrange(len(content) - length)
        if not finished and any(one.start - length < at < one.stop for one in last):
            return damage(rng, path, strange)  # what is written over at the end
        if kind == "flip" and not content[at] and not any(one.start <= at < one.stop for one in stands):
            return damage(rng, path, strange)  # between chunks and pages of HDF5's tables nothing stands
        content[at : at + length] = bytes(length) if kind == "zeroed" else [content[at] ^ 1 << rng.randrange(8)]
    elif kind in ("cut", "empty", "missing"):
        content = content[: rng.randrange(len(content)) if kind == "cut" else 0]
    elif kind == "longer":
        content += rng.randbytes(100)
    else:
        rows = [slice(table.digests_at + b * table.row_bytes, table.digests_at + (b + 1) * table.row_bytes)
                for b in (block, other)]  # fmt: skip
        if kind == "swapped":
            one, two = chunks[block][number], chunks[other][number]
            content[one], content[two] = content[two], content[one]
        elif kind == "swapped whole":
            for one, two in zip(chunks[block], chunks[other], strict=True):
                content[one], content[two] = content[two], content[one]
            content[rows[0]], content[rows[1]] = content[rows[1]], content[rows[0]]
        else:
            for at in [*chunks[block], rows[0]]:
                content[at] = strange[at]
    path.unlink() if kind == "missing" else path.write_bytes(content)
    return kind


def span(column, block):
    """Where a chunk of a column is, with its checksum."""
    return slice(int(column.at[block]), int(column.at[block]) + column.size + column.check)


def by_h5py(path):
    """All that h5py finds in a result: numbers and texts."""
    with h5py.File(path, "r") as file:
        own = dict(file.attrs)
        found = {name: file[name] for name in file if isinstance(file[name], h5py.Dataset)}
        texts = {
            name: {key: repr(thing.attrs[key]) for key in thing.attrs if key not in REFERENCES}
            for name, thing in found.items()
        }
        return repr(own), texts, {name: thing[()].tobytes() for name, thing in found.items()}


def by_xarray(path, engine):
    """All that xarray finds in a result by an engine."""
    with xr.open_dataset(path, engine=engine, decode_times=False) as found:
        names = {name: (repr(v.dims), repr(dict(v.attrs))) for name, v in found.variables.items()}
        return repr(dict(found.attrs)), names, {name: repr(v.values.tolist()) for name, v in found.variables.items()}


def by_sweep(path):
    """All that sweep finds in a result."""
    with sweep.open_result(path) as found:
        names = {name: (repr(v.dims), repr(dict(v.attrs))) for name, v in found.variables.items()}
        return repr(dict(found.attrs)), names, {name: repr(v.values.tolist()) for name, v in found.variables.items()}


REFERENCES = ("DIMENSION_LIST", "REFERENCE_LIST")
READERS = {
    "sweep": by_sweep,
    "h5py": by_h5py,
    "xarray, h5netcdf": lambda path: by_xarray(path, "h5netcdf"),
    "xarray, netcdf4": lambda path: by_xarray(path, "netcdf4"),
}


def heap(content):
    """Where the global heap of HDF5 is, which has no checksum: in damage there HDF5 may loop for ever."""
    at = content.index(b"GCOL")
    return range(at, at + int.from_bytes(content[at + 8 : at + 16], "little"))


def misread(rng, result, scratch, sound):
    """Flips a bit of a finished result; where, and who read something else then: "" where nobody did.

    Parameters
    ----------
    sound : mapping of str to object
        What each reader finds without damage.
    """
    content, path = bytearray(result.read_bytes()), scratch / "flipped.h5"
    at = rng.randrange(len(content))
    content[at] ^= 1 << rng.randrange(8)
    path.write_bytes(content)
    in_heap = at in heap(content) if b"GCOL" in content else True
    wrong, refused = [], 0
    for name, read in READERS.items():
        if in_heap and name != "sweep":
            continue
        try:
            wrong += [name] if read(path) != sound[name] else []
        except Exception:
            refused += 1
    wrong += ["verify"] if verify(path).whole else []
    return f"heap, {refused} refuse" if in_heap else f"{refused} of 4 refuse", "; ".join(wrong)


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
