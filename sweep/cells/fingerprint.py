"""Fingerprint of a result: the study, the sources of its kernel and of this engine, and the compiler."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import json
import os
import sys
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

import numpy as np

from kernels import catalogue
from sweep.study.model import Study, short

COMPILERS = ("numba", "llvmlite", "numpy")
OURS = ("kernels", "sweep.cells", "sweep.study")
"""Packages of which every source counts: the kernels, and what chooses methods, makes cells and reduces them."""
SOURCE = "source "


def fingerprint(study: Study) -> dict[str, str]:
    """Everything that decides the numbers of a result, as texts: equal fingerprints, equal bits.

    Returns
    -------
    dict of str to str
        "study" is one digest of all that the study says but for its words; what it says follows in short, under its
        names in a study file. Then a digest of the sources of each package ("source kernels"), those of a user's own
        that a kernel "module:NAME" is made of among them, and the versions of compiler and arrays. The processor is
        not in it: kernels give the same bits on each.
    """
    of_study = said(study)
    return {
        "study": hashlib.sha256(json.dumps(of_study).encode()).hexdigest(),
        **of_study,
        **{SOURCE + name: _as_begun(name) for name in OURS},
        **own_sources(study.kernel_name),
        **{name: version(name) for name in COMPILERS},
    }


def is_own_source(name: str) -> bool:
    """Whether an entry of a fingerprint is of a package of a user's own."""
    return name.startswith(SOURCE) and name.removeprefix(SOURCE) not in OURS


def difference(old: Mapping[str, str], new: Mapping[str, str]) -> list[str]:
    """What two fingerprints differ in, a line each: 'axes.mu: was 401 values ..., now 101 values ...'."""
    names = [name for name in {**new, **old} if old.get(name) != new.get(name)]
    lines = []
    # the digest of the whole study tells nothing where its parts do
    for name in (name for name in names if name != "study" or names == ["study"]):
        was, now = old.get(name), new.get(name)
        if name.startswith(SOURCE) or name == "study":  # a digest tells a reader nothing
            lines.append(f"{name}: {'new' if was is None else 'gone' if now is None else 'changed'}")
        else:
            change = f"was {was}, now {now}" if was is not None else f"new, {now}"
            lines.append(f"{name}: {change if now is not None else f'gone, was {was}'}")
    return lines


def said(study: Study) -> dict[str, str]:
    """What the study says, exactly: the entries of a fingerprint that do not tell of the program."""
    found = {
        "kernel": study.kernel_name,
        "method": study.method,
        "rtol": repr(study.rtol),
        "outputs": ", ".join(study.outputs),
        "design": study.design,
        "axes": ", ".join(study.axes),
    }
    found |= {"where": study.where} if study.where else {}
    found |= {"dims": ", ".join(f"{dim} ({', '.join(n)})" for dim, n in study.dims.items())} if study.blocks else {}
    found |= {f"axes.{name}": _values(axis.values) for name, axis in study.axes.items()}
    found |= {f"fixed.{n}": _values(value) if np.ndim(value) else repr(value) for n, value in study.fixed.items()}
    found |= {f"fixed.{name}": f"as {axis}" for name, axis in study.follows.items()}
    found |= {f"along.{name}": _values(values) for name, values in study.along.items() if len(values)}
    if study.summary is not None:
        found |= {"summary.over": ", ".join(study.summary.over)}
        found |= {f"summary.outputs.{name}": ", ".join(words) for name, words in study.summary.outputs.items()}
        found |= {f"summary.edges.{name}": _values(edges) for name, edges in study.summary.edges.items()}
    return found


def _values(values: Any) -> str:
    """'401 values, 0.0001 to 1e+06 (digest 0123456789abcdef)'."""
    digest = hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()[:16]
    ends = short(values[0]) if len(values) == 1 else f"{short(values[0])} to {short(values[-1])}"
    return f"{len(values)} value{'s' * (len(values) > 1)}, {ends} (digest {digest})"


def own_sources(kernel_name: str) -> dict[str, str]:
    """The entries of a user's own packages that a kernel is made of, as this process has loaded them.

    An edit changes neither them nor the numbers that are computed here, until one of their modules is imported anew.
    """
    if kernel_name in catalogue.KERNELS:
        return {}
    module = kernel_name.partition(":")[0]
    names, loaded, found = _loaded.get(module, ([module], [], {}))
    if not loaded or [*map(id, loaded)] != [*map(id, _specs(names))]:
        names = _own_packages(module)
        found = {SOURCE + name: digest for name in names if (digest := _digest(name))}
        _loaded[module] = names, _specs(names), found
    return found


_loaded: dict[str, tuple[list[str], list[Any], dict[str, str]]] = {}
"""By a kernel's module: its packages, what Python found of their modules as it imported them, and their entries."""


def _specs(names: list[str]) -> list[Any]:
    """What each import of a module of some packages has made anew."""
    return [vars(m).get("__spec__") for name, m in [*sys.modules.items()] if m and name.partition(".")[0] in names]


def _own_packages(module: str) -> list[str]:
    """Top-level names of a module and of what it imports, directly or not, and nothing of which is run.

    What is Python's, or installed from a distribution, is left out.
    """
    python, installed = Path(os.__file__).parent, {"site-packages", "dist-packages"}
    places = ((place, Path(place).resolve()) for place in sys.path)
    own = [
        place
        for place, path in places
        if path.is_dir() and not installed.intersection(path.parts) and not path.is_relative_to(python)
    ]
    finder = ModuleFinder(own, excludes=["kernels", "sweep"])
    with contextlib.suppress(ImportError):  # where it is installed, or typed at the prompt
        finder.import_hook(module)
    return sorted({name.partition(".")[0] for name in (module, *finder.modules)} - {"kernels", "sweep"})


def _digest(name: str) -> str:
    """Digest of all source files of a package, or of the file of a module; "" of what has no file."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        spec = None
    if spec is None or spec.origin in ("built-in", "frozen"):
        return ""
    files = [Path(spec.origin)] if spec.origin else []
    if (places := spec.submodule_search_locations) is not None:
        files = sorted(path for place in places for path in Path(place).rglob("*.py"))
    digests = b"".join(hashlib.sha256(path.read_bytes()).digest() for path in files)
    return hashlib.sha256(digests).hexdigest() if files else ""


_as_begun = cache(_digest)
"""Of one of our packages, as this process began with it."""


@cache
def version(name: str) -> str:
    """Of a package."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "(not installed)"
