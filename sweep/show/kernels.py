"""What `sweep kernels` prints: what can be swept."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from kernels import catalogue
from kernels.interface import KINDS, Field, Kernel, Method, Status
from sweep.errors import SweepError
from sweep.study.kernel_lookup import load_kernel
from sweep.study.mistakes import limits
from sweep.words import columns, listed, page, paragraph, quoted, section


def catalogue_text() -> str:
    """Every kernel of the catalogue in a few lines."""
    return page(
        *(_short(name) for name in catalogue.KERNELS),
        section("what becomes of a cell, in one word, and the statuses that say so", map(_kind, KINDS)),
        "`sweep kernels NAME` tells more of one of them.",
    )


def kernel_text(name: str, allow_import: bool = False) -> str:
    """All about one kernel, and a study to begin with. Raises SweepError."""
    kernel = load_kernel(name, allow_import)
    return page(
        paragraph(f"{name}: {kernel.doc}"),
        paragraph(f"Source: {kernel.source}" if kernel.source else ""),
        section("parameters", map(_parameter, kernel.parameters)),
        section("outputs", map(_output, kernel.outputs)),
        section("coordinates that all cells share", map(_coordinate, kernel.along)),
        section(
            'methods, cheapest first; "auto" takes the first whose error bound meets rtol', map(_method, kernel.methods)
        ),
        "a study to begin with\n" + "\n".join(f"  {line}".rstrip() for line in _example(name, kernel).splitlines()),
    )


def write_starter(name: str, path: Path, allow_import: bool = False) -> None:
    """Write a study of a kernel to begin with. Raises SweepError; a file that is there is left alone.

    A kernel of one's own is looked up in the folder of the study, as it is when the study is run.
    """
    text = starter(name, allow_import, path.parent)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise SweepError(f"{path} is there already; name another file") from None
    except OSError as error:
        raise SweepError(f"{path} cannot be written: {error.strerror}") from None


def starter(name: str, allow_import: bool = False, folder: Path = Path()) -> str:
    """A study of a kernel to begin with, in TOML. Raises SweepError."""
    kernel = load_kernel(name, allow_import, [folder])
    question = f"{kernel.doc[0].upper()}{kernel.doc.splitlines()[0][1:]}: how does it change with its parameters?"
    return f"# {question}\n{_example(name, kernel)}\n"


def _short(name: str) -> str:
    try:
        kernel = load_kernel(name)
    except SweepError as error:
        return f"{name}\n  {error}"
    rows = [
        ("parameters", ", ".join(map(_name_and_default, kernel.parameters))),
        ("outputs", ", ".join(f"{o.name} [{o.unit}]{_along(o)}" for o in kernel.outputs)),
        ("methods", ", ".join(m.name for m in kernel.methods)),
    ]
    return paragraph(f"{name}: {kernel.doc.splitlines()[0]}") + f"\n{columns(rows)}"


def _kind(kind: str) -> tuple[str, ...]:
    return kind, f"{KINDS[kind]}: {', '.join(status.name for status in Status if status.kind == kind)}"


def _name_and_default(field: Field) -> str:
    return f"{field.name} [{field.unit}]" + ("" if field.default is None else f" = {_default(field)}")


def _parameter(field: Field) -> tuple[str, ...]:
    default = "required" if field.default is None else f"default {_default(field)}"
    doc = field.doc + _along(field).replace(" along", ", one for each")
    return field.name, f"[{field.unit}]", limits(field), default, doc


def _output(field: Field) -> tuple[str, ...]:
    return field.name, f"[{field.unit}]", _along(field).strip(), field.doc


def _coordinate(field: Field) -> tuple[str, ...]:
    return field.name, f"[{field.unit}]", limits(field), field.doc


def _method(method: Method) -> tuple[str, ...]:
    cannot = f"; cannot do {listed(method.excludes)}" if method.excludes else ""
    lacks = f"; does not give {listed(method.lacks)}" if method.lacks else ""
    return method.name, "states its error" if method.bound else "keeps rtol", method.doc + cannot + lacks


def _along(field: Field) -> str:
    return f" along {listed(field.dims, word='and')}" if field.dims else ""


def _default(field: Field) -> str:
    if field.default is None or isinstance(field.default, str):
        return field.default or "required"
    words = {float(number): word for word, number in field.choices.items()}
    return words.get(field.default, f"{field.default:g}")


def _example(name: str, kernel: Kernel) -> str:
    """A study that sweeps the first parameter that is a number."""
    first = next(p for p in kernel.parameters if not p.dims)
    values = {p.name: kernel.example.get(p.name, 1.0) for p in kernel.parameters}
    fixed = [p for p in kernel.parameters if p is not first and (p.default is None or p.name in kernel.example)]
    lines = [f'kernel = "{name}"', "", *_axis(first, values[first.name])]
    if fixed:
        lines += ["", "[fixed]", *(_entry(p, values[p.name]) for p in fixed)]
    for field in kernel.along:
        lines += ["", f"[along.{field.name}]", *_range(field)]
    return "\n".join(lines)


def _axis(field: Field, middle: Any) -> Iterable[str]:
    yield f"[axes.{field.name}]"
    if field.choices:
        yield f"values = [{quoted(field.choices)}]"
    elif field.integer:
        yield f"values = [{', '.join(f'{max(field.lower, 1) + i:g}' for i in range(3))}]"
    elif field.unit == "m":  # machines keep their kind when a length is changed by a fifth, not by ten
        yield from _spaced("linear", 0.8 * middle, 1.2 * middle, 41, "m")
    else:
        yield from _spaced("log", middle / 10, middle * 10, 41, field.unit)


def _entry(field: Field, value: Any) -> str:
    if field.choices:
        return f'{field.name} = "{next(iter(field.choices))}"'
    text = f"[{', '.join(f'{v:g}' for v in value)}]" if field.dims else f"{value:g}"
    return f'{field.name} = {{ value = {text}, unit = "{field.unit}" }}'


def _range(field: Field) -> Iterable[str]:
    if field.integer:
        return ["num = 10"]
    if field.unit == "rad" and field.upper - field.lower > 2 * math.pi:
        return _spaced("linear", 0, 360, 181, "degree")
    if math.isfinite(field.upper - field.lower):
        return ["num = 200"]
    return _spaced("linear", 0, 0.1, 51, "m") if field.unit == "m" else _spaced("log", 0.1, 100, 200, field.unit)


def _spaced(spacing: str, start: float, stop: float, num: int, unit: str) -> list[str]:
    return [f'spacing = "{spacing}"', f"start = {start:g}", f"stop = {stop:g}", f"num = {num}", f'unit = "{unit}"']
