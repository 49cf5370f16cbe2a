"""What decides the numbers of a result: the study, the sources of its kernel and of this engine, and the compiler."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import metadata
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

import numpy as np

from kernels import catalogue
from sweep.study.model import Study, Summary, short

COMPILERS = ("numba", "llvmlite", "numpy")
OURS = ("kernels", "sweep.cells", "sweep.study")
"""Packages of which every source counts: the kernels, and what chooses methods, makes cells and reduces them."""
INSTALLED = frozenset(("site-packages", "dist-packages"))
SOURCE = "source "


def is_of_program(name: str) -> bool:
    """Whether an entry of a fingerprint tells of the program, not of the study."""
    return name.startswith(SOURCE) or name in COMPILERS


def fingerprint(study: Study) -> dict[str, str]:
    """Everything that decides the numbers of a result, as texts: equal fingerprints, equal bits.

    Returns
    -------
    dict of str to str
        "study" is one digest of all that the study says but for its words; what it says follows in short, under its
        names in a study file. Then a digest of the sources of each package ("source kernels"), and the versions of
        compiler and arrays. The processor is not in it: kernels give the same bits on each.
    """
    said = _said(study)
    whole = hashlib.sha256(json.dumps(said).encode()).hexdigest()
    return {
        "study": whole,
        **said,
        **{SOURCE + name: _of_package(name) for name in OURS},
        **_own_sources(study.kernel_name),
        **{name: version(name) for name in COMPILERS},
    }


def difference(old: Mapping[str, str], new: Mapping[str, str]) -> list[str]:
    """What two fingerprints differ in, a line each: 'axes.mu: was 401 values ..., now 101 values ...'."""
    names = [*new, *(name for name in old if name not in new)]
    changed = [name for name in names if old.get(name) != new.get(name)]
    # the digest of the whole study tells nothing where its parts do
    changed = [name for name in changed if name != "study"] or changed
    return [_change(name, old.get(name), new.get(name)) for name in changed]


def _change(name: str, old: str | None, new: str | None) -> str:
    digest = name.startswith(SOURCE) or name == "study"  # it tells a reader nothing
    if old is None:
        return f"{name}: new" if digest else f"{name}: new, {new}"
    if new is None:
        return f"{name}: gone" if digest else f"{name}: gone, was {old}"
    return f"{name}: changed" if digest else f"{name}: was {old}, now {new}"


def _said(study: Study) -> dict[str, str]:
    """What the study says, exactly."""
    said = {
        "kernel": study.kernel_name,
        "method": study.method,
        "rtol": repr(study.rtol),
        "outputs": ", ".join(study.outputs),
        "design": study.design,
        "axes": ", ".join(study.axes),
    }
    said |= {"where": study.where} if study.where else {}
    said |= {"dims": ", ".join(f"{dim} ({', '.join(n)})" for dim, n in study.dims.items())} if study.blocks else {}
    said |= {f"axes.{name}": _values(axis.values) for name, axis in study.axes.items()}
    said |= {f"fixed.{n}": _values(value) if np.ndim(value) else repr(value) for n, value in study.fixed.items()}
    said |= {f"fixed.{name}": f"as {axis}" for name, axis in study.follows.items()}
    said |= {f"along.{name}": _values(values) for name, values in study.along.items() if len(values)}
    return said if study.summary is None else said | _kept(study.summary)


def _kept(summary: Summary) -> dict[str, str]:
    """What the study says of its summary."""
    said = {"summary.over": ", ".join(summary.over)}
    said |= {f"summary.outputs.{name}": ", ".join(words) for name, words in summary.outputs.items()}
    return said | {f"summary.edges.{name}": _values(edges) for name, edges in summary.edges.items()}


def _values(values: Any) -> str:
    """'401 values, 0.0001 to 1e+06 (digest 0123456789abcdef)'."""
    digest = hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()[:16]
    ends = short(values[0]) if len(values) == 1 else f"{short(values[0])} to {short(values[-1])}"
    return f"{len(values)} value{'s' * (len(values) > 1)}, {ends} (digest {digest})"


def _own_sources(kernel_name: str) -> dict[str, str]:
    """A digest of each package or module of a user's own that a kernel's module imports, and of that module's own."""
    if kernel_name in catalogue.KERNELS:
        return {}
    module = kernel_name.partition(":")[0]
    known = _known.get((module, *sys.path))
    if known is None or known[0] != _stamps(known[0]):
        found = {name: files for name in _own_modules(module) if (files := _files(name))}
        digests = {SOURCE + name: _digest(files) for name, files in found.items()}
        known = _known[module, *sys.path] = _stamps(path for files in found.values() for path in files), digests
    return known[1]


_known: dict[tuple[str, ...], tuple[dict[Path, int], dict[str, str]]] = {}
"""By module and places to look for others: times at which the files were changed, and digests."""


def _stamps(files: Iterable[Path]) -> dict[Path, int]:
    """When files were changed."""
    return {path: path.stat().st_mtime_ns for path in files if path.exists()}


def _own_modules(module: str) -> list[str]:
    """Top-level names of a module and of what it imports of a user's own, directly or not; none of it is run."""
    finder = ModuleFinder([*_own_places()], excludes=["kernels", "sweep"])
    with contextlib.suppress(ImportError):  # where it is installed, or typed at the prompt
        finder.import_hook(module)
    return sorted({name.partition(".")[0] for name in (module, *finder.modules)} - {"kernels", "sweep"})


def _own_places() -> Iterator[str]:
    """Places of modules that are neither Python's nor installed from a distribution."""
    python = Path(os.__file__).parent
    for place in sys.path:
        path = Path(place).resolve()
        if path.is_dir() and not INSTALLED.intersection(path.parts) and not {path, *path.parents} & {python}:
            yield place


@cache
def _of_package(name: str) -> str:
    """Digest of the sources of one of our packages, as this process began with them."""
    return _digest(_files(name))


def _files(name: str) -> list[Path]:
    """All source files of a package, or the file of a module; none of what has no file."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return []
    if spec is None or spec.origin in ("built-in", "frozen"):
        return []
    if spec.submodule_search_locations is not None:
        return sorted(path for place in spec.submodule_search_locations for path in Path(place).rglob("*.py"))
    return [Path(spec.origin)] if spec.origin else []


def _digest(files: Iterable[Path]) -> str:
    """Of sources, in their order."""
    whole = hashlib.sha256()
    for path in files:
        whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


@cache
def version(name: str) -> str:
    """Of a package."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "(not installed)"
