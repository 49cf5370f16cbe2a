"""What decides the numbers of a result: the study, the sources of its kernel, and the compiler."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from kernels import catalogue
from sweep.study.model import Study, Summary, short

COMPILERS = ("numba", "llvmlite", "numpy")
OURS = ("kernels",)
"""Packages whose modules count even where a kernel of another package imports them."""

ENGINE = ("sweep.cells.solve", "sweep.cells.turns", "sweep.cells.grid")
"""Modules of the engine that decide values: the method of each cell, and its parameters."""

ASKING = ("sweep.study.condition",)
"""Those that decide which cells are asked for, where the study has a condition."""

REDUCING = ("sweep.cells.partition", "sweep.cells.reduce", "sweep.cells.output_schema")
"""Those that decide the values of a summary."""

SOURCE = "source "
MOST_SOURCES = 8
"""Source files that are named one by one where two fingerprints differ in them."""

IMPORTERS = ("import_module", "__import__", "load")
NAME = re.compile(r"[\w.]+")
IMPORT_FROM = re.compile(r"^[ \t]*from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n(]*)", re.MULTILINE)
IMPORT = re.compile(r"^[ \t]*import[ \t]+([\w., \t]+)", re.MULTILINE)


def is_of_program(name: str) -> bool:
    """Whether an entry of a fingerprint tells of the program, not of the study."""
    return name.startswith(SOURCE) or name in COMPILERS


def fingerprint(study: Study) -> dict[str, str]:
    """Everything that decides the numbers of a result, as texts: equal fingerprints, equal bits.

    Returns
    -------
    dict of str to str
        "study" is one digest of all that the study says but for its words; what it says follows in short, under its
        names in a study file. Then a digest per source file of the kernel ("source kernels.foliot.cycle"), and the
        versions of compiler and arrays. The processor is not in it: kernels give the same bits on each.
    """
    said = _said(study)
    whole = hashlib.sha256(json.dumps(said).encode()).hexdigest()
    engine = (*ENGINE, *(REDUCING if study.summary else ()), *(ASKING if study.where else ()))
    return {
        "study": whole,
        **said,
        **_sources(study.kernel_name, engine),
        **{name: version(name) for name in COMPILERS},
    }


def difference(old: Mapping[str, str], new: Mapping[str, str]) -> list[str]:
    """What two fingerprints differ in, a line each: 'axes.mu: was 401 values ..., now 101 values ...'.

    Of more than `MOST_SOURCES` source files there is one line, 'source of 78 modules: 57 new, 2 changed, 19 gone'.
    """
    names = [*new, *(name for name in old if name not in new)]
    changed = [name for name in names if old.get(name) != new.get(name)]
    # the digest of the whole study tells nothing where its parts do
    changed = [name for name in changed if name != "study"] or changed
    sources = [name for name in changed if name.startswith(SOURCE)]
    together = sources if len(sources) > MOST_SOURCES else []
    lines = [_change(name, old.get(name), new.get(name)) for name in changed if name not in together]
    return lines + ([_together(sources, old, new)] if together else [])


def _together(sources: Sequence[str], old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """One line of many source files."""
    words = Counter("new" if name not in old else "changed" if name in new else "gone" for name in sources)
    parts = [f"{words[word]} {word}" for word in ("new", "changed", "gone") if words[word]]
    return f"{SOURCE}of {len(sources)} modules: {', '.join(parts)}"


def _change(name: str, old: str | None, new: str | None) -> str:
    if old is None:
        return f"{name}: new" if name.startswith(SOURCE) else f"{name}: new, {new}"
    if new is None:
        return f"{name}: gone" if name.startswith(SOURCE) else f"{name}: gone, was {old}"
    return f"{name}: changed" if name.startswith(SOURCE) or name == "study" else f"{name}: was {old}, now {new}"


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


def _sources(kernel_name: str, engine: Sequence[str]) -> dict[str, str]:
    """A digest of every source file that takes part in solving a cell."""
    entry = catalogue.KERNELS.get(kernel_name, kernel_name).partition(":")[0]
    packages = {entry.partition(".")[0], *OURS}
    found: dict[str, str] = {}
    waiting, seen = [entry], set[str]()
    while waiting:
        name = waiting.pop()
        path = None if name in seen else _path(name)
        seen.add(name)
        if path is None:
            continue
        found[name], imported = _read(path, name, path.stat().st_mtime_ns)
        own = {package for package in imported if package in packages or _is_own(package)}
        waiting += [n for package in own for n in imported[package] if n not in seen]
    for name in engine:
        path = _path(name)
        if path is not None:
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return {SOURCE + name: found[name] for name in sorted(found)}


@lru_cache(maxsize=1000)
def _is_own(package: str) -> bool:
    """Whether a package is source of somebody's own: neither Python's nor installed from a distribution."""
    if package in sys.stdlib_module_names or package == "sweep":
        return False
    path = _path(package)
    return path is not None and not {"site-packages", "dist-packages"}.intersection(path.parts)


@lru_cache(maxsize=1000)
def _read(path: Path, name: str, modified: int) -> tuple[str, dict[str, list[str]]]:
    """Digest of a source file, and what it imports by package; kept while the file's time of modification stays."""
    text, found = path.read_bytes(), dict[str, list[str]]()
    names = [name, *(_imported(text, name, path) if path.suffix == ".py" else ())]
    # with a.b.c Python also runs a and a.b
    for module in dict.fromkeys(n.rsplit(".", k)[0] for n in names for k in range(n.count(".") + 1)):
        found.setdefault(module.partition(".")[0], []).append(module)
    return hashlib.sha256(text).hexdigest(), found


def _path(name: str) -> Path | None:
    """File of a module, which is not imported; None of what has no file, or is no module."""
    path = _found(name, tuple(sys.path))
    return path if path is not None and path.is_file() else None


@lru_cache(maxsize=4000)
def _found(name: str, places: tuple[str, ...]) -> Path | None:
    """The same, looked for once while `sys.path` is as it was."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError, AttributeError):
        file = getattr(sys.modules.get(name), "__file__", None)
        return Path(file) if file else None
    return Path(spec.origin) if spec is not None and spec.origin else None


def _imported(text: bytes, name: str, path: Path) -> Iterator[str]:
    """Names of modules that a source may import: in statements, in calls, or in a text that modules are written from.

    A call whose argument is no text in the source tells nothing here.
    """
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from _members(_absolute(package, node.level, node.module), [alias.name for alias in node.names])
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from _written(node.value)
        elif isinstance(node, ast.Call):
            yield from _called(node, package)


def _members(base: str, names: Iterable[str]) -> Iterator[str]:
    """Of `from a import b` both a and a.b, as b may be a module."""
    yield base
    yield from (f"{base}.{name}" for name in names)


def _absolute(package: Sequence[str], level: int, module: str | None) -> str:
    above = package[: len(package) - level + 1] if level else []
    return ".".join([*above, *filter(None, [module])])


def _written(text: str) -> Iterator[str]:
    """What the lines of a text import; names in braces are filled in later and are not followed."""
    for base, names in IMPORT_FROM.findall(text):
        yield from _members(base, NAME.findall(names))
    for names in IMPORT.findall(text):
        yield from NAME.findall(names)


def _called(node: ast.Call, package: Sequence[str]) -> Iterator[str]:
    """The module of `import_module("a.b")` and its like."""
    function = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if function in IMPORTERS and node.args and isinstance(node.args[0], ast.Constant):
        name = str(node.args[0].value).partition(":")[0]
        module = name.lstrip(".")
        yield _absolute(package, len(name) - len(module), module)


@cache
def version(name: str) -> str:
    """Of a package."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "(not installed)"
