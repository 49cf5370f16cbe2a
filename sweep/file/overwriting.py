"""What may be overwritten: what an earlier command of the same kind wrote; all else by force; what is read, never.

A file is known by how it begins, and by words that stand in it.
"""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from pathlib import Path

from sweep.errors import SweepError

EXPORTED = "exported by foliot"
"""In every table or Dataset that is exported."""
DRAWN = "foliot"
"""What made a picture, as its metadata say: a script or a program with foliot; commands have names of their own."""
PAGE = '<meta name="generator" content="foliot">'
LAWS = "y,x,law,"

MARKS = {
    ".csv": (f"# {EXPORTED}\n", ""),
    ".parquet": ("PAR1", EXPORTED),
    ".nc": ("\x89HDF", EXPORTED),
    "laws": (LAWS, ""),
    "page": ("<!DOCTYPE html>", PAGE),
    ".png": ("\x89PNG", "Software\0{by}"),
    ".svg": ("<?xml", "<dc:title>{by}</dc:title>"),
    ".pdf": ("%PDF", "/Creator ({by})"),
}
"""Kinds of file: their first characters, and what stands somewhere behind them; of a picture, what drew it."""


def check_target(target: Path, kind: str, *, force: bool = False, read: Sequence[Path] = (), by: str = DRAWN) -> None:
    """Raises SweepError where a file of some kind is not to be written to `target`.

    Parameters
    ----------
    kind : str
        Of `MARKS`, or ".zarr". What is of no kind is left to who writes it.
    force : bool
        Whatever is there may be overwritten,
    read : paths
        but for these.
    by : str
        What draws a picture: those of others are not overwritten.
    """
    if any(_same(target, one) for one in read):
        raise SweepError(f"{target} is what is read; name another file")
    known = kind in MARKS or kind == ".zarr"
    if force or not known or not target.exists() or _earlier(target, kind, by):
        return
    raise SweepError(
        f"{target} is there already, and not from an earlier command of this kind; "
        "move it, name another file, or overwrite it with --force (Python: force=True)"
    )


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:  # one of them is not there
        return one.resolve() == other.resolve()


def _earlier(target: Path, kind: str, by: str) -> bool:
    if kind == ".zarr":
        return target.is_dir() and _holds(target / "zarr.json", ("{", EXPORTED))
    begin, words = MARKS[kind]
    return _holds(target, (begin, words.format(by=by)))


def _holds(path: Path, mark: tuple[str, str]) -> bool:
    begin, words = (text.encode("latin-1") for text in mark)
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            if file.read(len(begin)) != begin:
                return False
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as whole:
                return whole.find(words) >= 0
    except OSError:
        return False
