"""Descriptions of kernels (parameters, outputs, methods) as text and HTML; an example study."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from kernels import catalogue
from kernels.interface import KINDS, Field, Kernel, Status
from sweep.study.mistakes import limits
from sweep.study.model import load_kernel
from sweep.words import Table, listed, page, paragraph, quoted


class KernelPage:
    """Description of a kernel, printed as text, and in a notebook as tables.

    Attributes
    ----------
    name : str
        Its name in a study.
    kernel : Kernel
        Its declaration: parameters, outputs, methods.
    """

    def __init__(self, name: str, allow_import: bool = False) -> None:
        self.name, self.kernel = name, load_kernel(name, allow_import)

    def __repr__(self) -> str:
        example = "\n".join(f"  {line}".rstrip() for line in starter(self.name, self.kernel).splitlines()[1:])
        return page(
            paragraph(f"{self.name}: {self.kernel.doc}"),
            paragraph(f"Source: {self.kernel.source}" if self.kernel.source else ""),
            *(table.text() for table in self._tables()),
            f"example of a study\n{example}",
        )

    def _repr_html_(self) -> str:
        head = f"<p><b>{escape(self.name)}</b>: {escape(self.kernel.doc)}</p>"
        return head + "".join(table.html() for table in self._tables())

    def _tables(self) -> list[Table]:
        kernel, methods, rows = self.kernel, list[Sequence[str]](), dict[str, list[Sequence[str]]]()
        for method in kernel.methods:
            cannot = f"; cannot do {listed(method.excludes)}" if method.excludes else ""
            lacks = f"; does not give {listed(method.lacks)}" if method.lacks else ""
            error = "stated per cell" if method.bound else "estimated per cell" if method.estimates else "within rtol"
            methods.append((method.name, error, method.doc + cannot + lacks))
        for group in ("parameters", "outputs", "along"):
            for field in getattr(kernel, group):
                words, value = {float(number): choice for choice, number in field.choices.items()}, field.default
                shown = value if isinstance(value, str | None) else words.get(value, f"{value:g}")
                counted = f" values from {field.lower:g} on" if group == "along" else ""
                default = "required" if value is None else f"{shown}{counted}"
                each = f", one per {listed(field.dims, word='and')}" if field.dims else ""
                row = (field.name, f"[{field.unit}]", limits(field), default, field.doc + each)
                rows.setdefault(group, []).append(row)
        cheapest = 'methods, cheapest first; "auto" takes the first whose error bound meets rtol'
        heading = ("unit", "allowed", "default", "meaning")
        return [
            Table(rows.get("parameters", ()), ("parameter", *heading), "parameters"),
            Table([(*row[:2], row[-1]) for row in rows.get("outputs", ())], ("output", "unit", "meaning"), "outputs"),
            Table(rows.get("along", ()), ("coordinate", *heading), "coordinates that all cells share"),
            Table(methods, ("method", "error", "how"), cheapest),
        ]


class Catalogue(Mapping[str, KernelPage]):
    """All kernels of the catalogue by name."""

    def __getitem__(self, name: str) -> KernelPage:
        if name not in catalogue.KERNELS:
            raise KeyError(name)
        return KernelPage(name)

    def __iter__(self) -> Iterator[str]:
        return iter(catalogue.KERNELS)

    def __len__(self) -> int:
        return len(catalogue.KERNELS)

    def __repr__(self) -> str:
        return catalogue_text()

    def _repr_html_(self) -> str:
        rows = [(name, _first(one.kernel), ", ".join(m.name for m in one.kernel.methods)) for name, one in self.items()]
        return Table(rows, ("kernel", "scene", "methods")).html()


def kernels(name: str | None = None, allow_import: bool = False) -> Catalogue | KernelPage:
    """List the kernels of the catalogue, or describe one: its parameters, units, outputs and methods.

    Parameters
    ----------
    name : str, optional
        Name in the catalogue, or "module:NAME".
    allow_import : bool
        Allow "module:NAME", whose module is imported.

    Raises
    ------
    SweepError
        There is no such kernel.

    Examples
    --------
    >>> import sweep
    >>> list(sweep.kernels())[:3]
    ['foliot', 'foliot_motion', 'foliot_ripple']
    >>> sweep.kernels("foliot").kernel.parameter("mu").unit
    'rad/s^2'
    """
    return Catalogue() if name is None else KernelPage(name, allow_import)


def catalogue_text(complete: bool = False) -> str:
    """A line for each kernel; optionally all about each, and all statuses."""
    if complete:
        names = {kind: ", ".join(status.name for status in Status if status.kind == kind) for kind in KINDS}
        statuses = Table(((kind, f"{KINDS[kind]}: {names[kind]}") for kind in KINDS), title="statuses of cells")
        return page(*map(repr, Catalogue().values()), statuses.text())
    rest = "`sweep kernels NAME` describes one of them, `sweep kernels --all` all of them and the statuses."
    rows = ((name, _first(load_kernel(name))) for name in catalogue.KERNELS)
    return page(Table(rows).text(indent=""), paragraph(rest))


def write_starter(name: str, path: Path, allow_import: bool = False, force: bool = False) -> None:
    """Write an example study of a kernel. Raises SweepError, also if the file exists, unless with `force`.

    A kernel of one's own is looked up in the folder of the study, as it is when the study is run.
    """
    from sweep.file import disk

    text = starter(name, load_kernel(name, allow_import, [path.parent]))
    disk.check_target(path, force=force)
    with disk.replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def starter(name: str, kernel: Kernel | None = None) -> str:
    """An example study of a kernel, in TOML, which sweeps its first parameter that is a number. Raises SweepError."""
    kernel = kernel or load_kernel(name)
    first = next(p for p in kernel.parameters if not p.dims)
    values = {p.name: kernel.example.get(p.name, 1.0) for p in kernel.parameters}
    question = f"{kernel.doc[0].upper()}{_first(kernel)[1:]}: how does it change with its parameters?"
    lines = [f"# {question}", f'kernel = "{name}"', ""]
    lines += [f"[axes.{first.name}]", *_spacing(first, values[first.name])]
    fixed = [p for p in kernel.parameters if p is not first and (p.default is None or p.name in kernel.example)]
    lines += ["", "[fixed]"] if fixed else []
    for field in fixed:
        value = values[field.name]
        text = f"[{', '.join(f'{v:g}' for v in np.atleast_1d(value))}]" if field.dims else f"{value:g}"
        entry = f'"{next(iter(field.choices))}"' if field.choices else f'{{ value = {text}, unit = "{field.unit}" }}'
        lines.append(f"{field.name} = {entry}")
    for field in (field for field in kernel.along if field.default is None):
        lines += ["", f"[along.{field.name}]", *_spacing(field)]
    return "\n".join(lines) + "\n"


def _spacing(field: Field, middle: Any = None) -> list[str]:
    """Values of an axis around a middle one, or without one of a coordinate that all cells share."""
    unit = field.unit
    if middle is not None and field.choices:
        return [f"values = [{quoted(field.choices)}]"]
    if field.integer:
        least = max(field.lower, 1)
        return ["num = 10"] if middle is None else [f"values = [{least:g}, {least + 1:g}, {least + 2:g}]"]
    if middle is not None:  # machines keep their kind when a length is changed by a fifth, not by ten
        ends = ("linear", 0.8 * middle, 1.2 * middle, 41) if unit == "m" else ("log", middle / 10, middle * 10, 41)
    elif unit == "rad" and field.upper - field.lower > 2 * math.pi:
        ends, unit = ("linear", 0, 360, 181), "degree"
    elif math.isfinite(field.upper - field.lower):
        return ["num = 200"]
    else:
        ends = ("linear", 0, 0.1, 51) if unit == "m" else ("log", 0.1, 100, 200)
    spacing, start, stop, num = ends
    return [f'spacing = "{spacing}"', f"start = {start:g}", f"stop = {stop:g}", f"num = {num}", f'unit = "{unit}"']


def _first(kernel: Kernel) -> str:
    return kernel.doc.splitlines()[0]
