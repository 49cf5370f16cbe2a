"""Results that somebody has forged: changed by h5py or byte by byte, and sealed anew, in part or not at all.

Commands are given them in processes of their own, forked off one that has imported everything.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import resource
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import xxhash
from havoc import study

from sweep.cli import main
from sweep.runs.run import run
from sweep.store.layout import MAGIC, Layout, read_layout, structure_digest
from sweep.study.toml import to_toml

SECONDS, PATIENCE, MEMORY = 20.0, 120.0, 1 << 30
"""What a command may take of a processor, of time on a machine that does other things too, and of memory."""
ATTRS = ("study_json", "fingerprint", "end", "begin", "versions", "kernel", "method", "rtol", "coordinates", "over",
         "units", "long_name", "flag_values", "flag_meanings", "DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME",
         "_Netcdf4Dimid", "_FillValue", "scale_factor", "missing_value", "columns", "cells_per_second")  # fmt: skip
DTYPES = ("f4", ">f8", "f2", "i8", "u8", "i1", "?", "c16", "S5", "V7", [("a", "f8"), ("b", "i4")], "(3,)f8",
          h5py.string_dtype(), h5py.vlen_dtype("f8"), h5py.enum_dtype({"OK": 0, "no": 1}, "i1"), h5py.ref_dtype,
          h5py.regionref_dtype)  # fmt: skip
SHAPES = ((), (0,), (1,), (7,), (100, 3, 0), (3, 100), (100, 3, 2, 2), (100, 4), (2**40,), (2**20, 2**20), (1,) * 32)


def prepared(folder: Path) -> Path:
    """A finished result to be forged, and the study that it is of."""
    given = study(300)
    (folder / "study.toml").write_text(to_toml(given), encoding="utf-8")
    run(given, folder / "whole.h5", workers=1, block_cells=100, progress=False).close()
    return folder / "whole.h5"


def forged(rng: random.Random, whole: Path, path: Path) -> str:
    """Writes a forged copy of a result; says how."""
    path.write_bytes(whole.read_bytes())
    with path.open("r+b") as file:
        layout = read_layout(file.fileno(), path.stat().st_size)
        assert layout is not None
        trailer = layout.trailer()
        change: Callable[..., object] = rng.choice(CHANGES)
        if change in (bytes_of_header, numbers):
            change(rng, file, layout)
            seal = rng.choice(("anew", "anew", "old"))
        elif change is layout_itself:
            file.truncate(layout.end)
            file.seek(layout.end)
            file.write(layout_itself(rng, layout))
            return "layout_itself"
        else:
            file.truncate(layout.end)
            file.close()
            by_h5py(rng, path, change)
            seal = rng.choice(("anew", "anew", "anew", "old", "none"))
    with path.open("r+b") as file:
        end = file.seek(0, 2) - (len(trailer) if change in (bytes_of_header, numbers) else 0)
        file.seek(end)
        if seal == "anew":
            known = [r for r in (*layout.regions, *layout.endings) if r[1] <= end]
            new = replace(layout, end=end, regions=tuple(r for r in layout.regions if r[1] <= end),
                          structure=structure_digest(file.fileno(), known, end))  # fmt: skip
            trailer = new.trailer()
        if seal != "none":
            file.write(trailer)
    return f"{change.__name__}, seal {seal}"


def by_h5py(rng: random.Random, path: Path, change: Callable[..., object]) -> None:
    """One change or some of a kind; those that h5py refuses are left out."""
    with h5py.File(path, "r+") as file:
        for _ in range(rng.choice((1, 1, 3))):
            with contextlib.suppress(ValueError, TypeError, OSError, KeyError, RuntimeError, OverflowError):
                change(rng, file)


def anything(rng: random.Random) -> object:
    """A value for an attribute."""
    return rng.choice((
        "", "nan", "x" * 60_000, "\x1b[31m=1+1", "\u2028é", "{}", "[]", '{"a": 1e999}', "[" * 20_000, -1, 2**63 - 1,
        float("nan"), float("inf"), True, np.zeros(0), np.arange(5), np.zeros((2, 2)), np.array([b"a", b"b"]),
        np.bytes_(b"\xff\xfe"), h5py.Empty("f8"), h5py.Empty(h5py.string_dtype()), np.arange(60_000.0)[:8000],
        np.array([(1, 2)], [("a", "i4"), ("b", "f8")]), ["a", "b"], np.complex128(1j), np.float16(2),
    ))  # fmt: skip


def holder(rng: random.Random, file: h5py.File) -> h5py.HLObject:
    """The file or something in it."""
    found: list[h5py.HLObject] = [file, file]
    file.visititems(lambda _, thing: found.append(thing))
    return rng.choice(found)


def attribute(rng: random.Random, file: h5py.File) -> None:
    """Another value, or none, for an attribute that is there, or one more."""
    thing = holder(rng, file)
    name = rng.choice([*thing.attrs, *ATTRS])
    if rng.random() < 0.2:
        del thing.attrs[name]
    else:
        thing.attrs[name] = anything(rng)


def story(rng: random.Random, file: h5py.File) -> None:
    """A word of the study as it is kept, or of its fingerprint, is another one."""
    name = rng.choice(("study_json", "fingerprint"))
    words = json.loads(file.attrs[name])
    inner, key = words, rng.choice([*words])
    while isinstance(inner[key], (dict, list)) and inner[key] and rng.random() < 0.8:
        inner = inner[key]
        key = rng.choice([*inner]) if isinstance(inner, dict) else rng.randrange(len(inner))
    others = (None, [], {}, "", "x", -1, 1e300, [[1]], [1.0] * 1000, {"a": 1}, True, "nan", 10**400)
    if isinstance(inner, dict) and rng.random() < 0.2:
        del inner[key]
    else:
        inner[key] = rng.choice(others)
    file.attrs[name] = json.dumps(words)


def many_attributes(rng: random.Random, file: h5py.File) -> None:
    """More attributes than a header holds, or a huge one."""
    thing = holder(rng, file)
    if rng.random() < 0.5:
        for number in range(3000):
            thing.attrs[f"a{number}"] = number
    else:
        thing.attrs.create("huge", np.zeros(rng.choice((10, 8_000_000))))


def dataset(rng: random.Random, file: h5py.File) -> None:
    """Of another type, shape, filter or chunks."""
    name = rng.choice([name for name in [*file, "integrity/cells_digests"] if isinstance(file.get(name), h5py.Dataset)])
    old = file[name]
    shape = rng.choice((old.shape, old.shape, *SHAPES))
    keys = {"dtype": rng.choice((old.dtype, *DTYPES)), "shape": shape}
    if shape and rng.random() < 0.6:
        keys["chunks"] = tuple(rng.choice((1, max(1, n // 2), max(1, min(n, 2**16)))) for n in shape)
        keys |= rng.choice((
            {}, {"compression": "gzip"}, {"compression": "lzf"}, {"shuffle": True}, {"fletcher32": True},
            {"scaleoffset": 2}, {"maxshape": (None,) * len(shape)}, {"fillvalue": 3},
        ))  # fmt: skip
    attrs = dict(old.attrs) if rng.random() < 0.7 else {}
    del file[name]
    new = file.create_dataset(name, **keys)
    for key, value in attrs.items():
        with contextlib.suppress(TypeError, ValueError, OSError, RuntimeError):
            new.attrs[key] = value
    if new.size < 1e6 and rng.random() < 0.5 and new.dtype.kind in "fiub":
        new[...] = np.resize(np.array([0, 1, -1, np.nan, np.inf, 1e308, 127]), new.shape).astype(new.dtype)


def bomb(rng: random.Random, file: h5py.File) -> None:
    """Zeros that take a thousandth of their room."""
    name = rng.choice([*file, "more"])
    with contextlib.suppress(KeyError):
        del file[name]
    count = rng.choice((10**7, 2 * 10**8))
    data = file.create_dataset(name, (count,), "f8", chunks=(10**6,), compression="gzip", compression_opts=9)
    piece = np.zeros(10**6)
    data[: 10**6] = piece
    packed = data.id.read_direct_chunk((0,))[1]
    for start in range(10**6, count, 10**6):
        data.id.write_direct_chunk((start,), packed)


def chunk(rng: random.Random, file: h5py.File) -> None:
    """Bytes that no filter made, or a mask that leaves filters out."""
    chunked = [thing for thing in map(file.get, file) if isinstance(thing, h5py.Dataset) and thing.chunks]
    data = rng.choice(chunked)
    place = data.id.get_chunk_info(rng.randrange(data.id.get_num_chunks())).chunk_offset
    size = rng.choice((0, 1, 100, int(np.prod(data.chunks)) * data.dtype.itemsize, 10_000))
    data.id.write_direct_chunk(place, rng.randbytes(size), rng.choice((0, 1, 0xFFFFFFFF)))


def link(rng: random.Random, file: h5py.File) -> None:
    """To elsewhere, to itself, or to nothing."""
    name = rng.choice([*file, "other", "integrity/other"])
    with contextlib.suppress(KeyError):
        del file[name]
    outside = str(Path(file.filename).with_name("secret"))
    kind = rng.choice(("soft", "nowhere", "round", "external", "storage", "virtual", "type"))
    if kind in ("soft", "nowhere"):
        file[name] = h5py.SoftLink("/fall_time" if kind == "soft" else f"/{name}")
    elif kind == "round":
        file[name] = file
    elif kind == "external":
        file[name] = h5py.ExternalLink(outside, "/")
    elif kind == "storage":
        file.create_dataset(name, (100, 3), "f8", external=[(outside, 0, h5py.h5f.UNLIMITED)])
    elif kind == "virtual":
        layout = h5py.VirtualLayout((100, 3), "f8")
        layout[...] = h5py.VirtualSource(outside, "x", (100, 3))
        file.create_virtual_dataset(name, layout)
    else:
        file[name] = np.dtype("f8")


def tree(rng: random.Random, file: h5py.File) -> None:
    """Groups instead of numbers, deep ones, or many things."""
    kind = rng.choice(("group", "deep", "many", "gone", "renamed"))
    name = rng.choice([*file])
    if kind in ("group", "gone"):
        del file[name]
    if kind == "group":
        file.create_group(name)["x"] = 1.0
    elif kind == "deep":
        file.create_group("/".join("d" * 500))
    elif kind == "many":
        for number in range(2000):
            file[f"x{number}"] = float(number)
    elif kind == "renamed":
        file.move(name, rng.choice(("status", "time", "x" * 300, "a\nb", "\x1b[2J", "é", "cell", "method_used")))


def values(rng: random.Random, file: h5py.File) -> None:
    """Coordinates, digests or flags that cannot be."""
    names = [name for name in [*file, "integrity/cells_digests"] if isinstance(file.get(name), h5py.Dataset)]
    data = file[rng.choice(names)]
    if data.dtype.kind == "O":
        data[...] = rng.choice(("", "x" * 100_000, "\x1b[31m", "nan"))
    elif data.dtype.kind in "fiu":
        data[...] = np.resize(np.array(rng.choice(([np.nan], [np.inf, -np.inf], [0], [-1], [77], [1, 0]))), data.shape)


def bytes_of_header(rng: random.Random, file: object, layout: Layout) -> None:
    """Bytes outside of the numbers: of object headers, heaps, trees."""
    apart = sorted((*layout.regions, *layout.endings))
    places = [at for at in range(layout.end) if not any(a <= at < b for a, b in apart)]
    for _ in range(rng.choice((1, 1, 2, 8))):
        file.seek(rng.choice(places))
        file.write(rng.choice((b"\0", b"\xff", rng.randbytes(1), rng.randbytes(1), rng.randbytes(8))))


def numbers(rng: random.Random, file: object, layout: Layout) -> None:
    """Another number in a column, with the digest that it has."""
    table = layout.work
    number, block = rng.randrange(len(table.places)), rng.randrange(table.blocks.count)
    place = table.places[number]
    start, stop = table.blocks.bounds(block)
    cells = place.empty(stop - start)
    cells[...] = rng.choice((0, 1, -1, 77, 127)) if cells.dtype.kind != "f" else rng.choice((np.nan, np.inf, -1.0, 0.0))
    digest = table.write(file.fileno(), block, {p.name: cells for p in (place,)} | _others(table, block, place, file))
    file.seek(table.digests + block * table.row_bytes)
    file.write(digest)


def _others(table: object, block: int, place: object, file: object) -> dict[str, object]:
    start, stop = table.blocks.bounds(block)
    found = {}
    for p in table.places:
        if p is not place:
            found[p.name] = p.empty(stop - start)
            os.preadv(file.fileno(), [memoryview(found[p.name]).cast("B")], p.at(block))
    return found


def layout_itself(rng: random.Random, layout: Layout) -> bytes:
    """The trailer with another word in it, and the right digest."""
    end = len(layout.trailer()) - 32
    words = json.loads(layout.trailer()[:end])
    inner, key = words, rng.choice([*words])
    while isinstance(inner[key], (dict, list)) and inner[key] and rng.random() < 0.9:
        inner = inner[key]
        key = rng.choice([*inner]) if isinstance(inner, dict) else rng.randrange(len(inner))
    others = (None, [], {}, "", "x", "f8", "O", "V8", "S0", "M8", "00", -1, 0, 1, 2, 2**31, 2**40, 2**62, 10**30, 0.5,
              True, [[0, 0, 0]])  # fmt: skip
    inner[key] = rng.choice(others)
    text = json.dumps(words).encode()
    return text + xxhash.xxh3_128(text).digest() + len(text).to_bytes(4, "little") + MAGIC


CHANGES = (attribute, story, story, many_attributes, dataset, dataset, bomb, chunk, link, tree, values,
           bytes_of_header, bytes_of_header, numbers, layout_itself, layout_itself)  # fmt: skip


def commands(path: Path, whole: Path) -> dict[str, list[str]]:
    """What reads a result."""
    study_path, folder = path.with_name("study.toml"), path.parent
    out = {name: str(folder / f"out{name}") for name in (".csv", ".png", ".html", ".nc", ".h5", "chart.png")}
    fit = ["--y", "fall_time", "--x", "height"]
    run_words = ["run", str(study_path), "-o", str(path), "--workers", "1", "--allow-import", "--no-isolate"]
    readers = {
        "show": ["show"], "verify": ["verify"], "fit": ["fit", *fit], "plot": ["plot", "-o", out[".png"]],
        "csv": ["export", "-o", out[".csv"]], "netCDF4": ["export", "-o", out[".nc"]],
        "report": ["report", "-o", out[".html"]], "diff": ["diff", str(whole)],
        "join": ["join", str(whole), "-o", out[".h5"]],
        "join --axis": ["join", str(whole), "-o", out[".h5"], "--axis", "version"],
        "refine": ["refine", "--y", "fall_time", "--tolerance", "0.1", "-o", out[".h5"], "--allow-import"],
        "chart": ["chart", "-o", out["chart.png"], "--allow-import", "--cells", "4", "--rtol", "1e-3"],
        "view": ["view", "--no-browser"],
    }  # fmt: skip
    forced = {name: [*words, "--force"] if "-o" in words else words for name, words in readers.items()}
    return {
        **{name: [words[0], str(path), *words[1:]] for name, words in forced.items()},
        "list": ["list", str(folder)],
        "run": run_words,
        **{f"run {option}": [*run_words, option] for option in ("--extend", "--repair", "--retry-failed")},
    }


class Became(NamedTuple):
    """How a command ended: exit status (-9: never), what it printed, seconds of a processor, bytes of memory."""

    code: int
    text: str
    seconds: float
    memory: int


def became(words: list[str], log: Path) -> Became:
    """How a command ends in a process of its own."""
    begun = time.monotonic()
    child = os.fork()
    if child == 0:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (16 << 30, 16 << 30))
        fd = os.open(log, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
        os.dup2(fd, 1), os.dup2(fd, 2)
        code = 99
        try:
            code = main(words)
        except SystemExit as ended:
            code = ended.code
        except BaseException:
            import traceback

            traceback.print_exc()
        finally:
            with contextlib.suppress(Exception):
                import sys

                sys.stdout.flush(), sys.stderr.flush()
            os._exit(code)
    while not (found := os.wait4(child, os.WNOHANG))[0] and time.monotonic() < begun + PATIENCE:
        time.sleep(0.005)
    if not found[0]:
        os.killpg(child, signal.SIGKILL)
        found = os.wait4(child, 0)
    _, status, used = found
    seconds = used.ru_utime + used.ru_stime
    return Became(os.waitstatus_to_exitcode(status), log.read_text(errors="replace"), seconds, used.ru_maxrss * 1024)


def wrong(words: list[str], end: Became) -> str:
    """What is wrong with how a command ended; "" where nothing is."""
    allowed = {"diff": {0, 1, 2}, "run": {0, 2, 4}}.get(words[0], {0, 2})
    if end.code not in allowed or "a fault in foliot" in end.text or "Traceback" in end.text:
        return f"exit status {end.code}: {end.text.strip()[-400:]}"
    if end.code == 2 and len(end.text.strip()) < 10:
        return f"says nothing but {end.text!r}"
    if end.seconds > SECONDS or end.memory > MEMORY:
        return f"takes {end.seconds:.1f} s and {end.memory >> 20} MB"
    return ""


def import_all() -> None:
    """Imports what the commands need, once for all; what serves a page ends at once."""
    import panel

    import sweep.analysis.scattered
    import sweep.explore.join
    import sweep.explore.refine
    import sweep.explore.work_precision
    import sweep.results.diff
    import sweep.results.export
    import sweep.results.listing
    import sweep.show.charts
    import sweep.show.laws
    import sweep.show.page
    import sweep.show.text
    import sweep.view.server  # noqa: F401

    def serve(*rest: object, **keys: object) -> object:
        raise SystemExit(0)

    panel.serve = serve
