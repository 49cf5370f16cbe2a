"""Turns the keys of a study into a checked `Study`: the values each key allows, and how keys must fit together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kernels import catalogue
from kernels.interface import Field, Kernel
from sweep.errors import StudyError
from sweep.study.condition import cells_where
from sweep.study.designs import field_of, read_designs
from sweep.study.mistakes import Entry, Mistakes, check_limits, exact_float, one_of, text
from sweep.study.model import SETTINGS, Axis, Block, Study, Summary, differs, frozen, load_kernel, setting
from sweep.study.values import Floats, axis, quantity
from sweep.words import did_you_mean, listed, nearest

KEYS = (
    "title", "question", "kernel", "method", "rtol", "outputs", "design", "axes", "blocks", "where", "fixed", "along",
    "summary",
)  # fmt: skip
REDUCTIONS = ("min", "max", "mean", "argmin", "argmax", "histogram")

Fixed = dict[str, float | Floats]


def read_keys(said: Mapping[str, Any], source_text: str, source: str, folder: Path, allow_import: bool) -> Study:
    """The study of the keys that a source says, and of its text. Raises StudyError with all that is wrong with it."""
    mistakes = Mistakes()
    keys = Entry(said, "", mistakes, folder).keys(*KEYS)
    kernel = _kernel(keys, source, allow_import)
    title, question, where = (keys.get(key, "", text) for key in ("title", "question", "where"))
    method = keys.get("method", "auto", one_of, setting("method", kernel).choices)
    rtol = keys.get("rtol", 1e-9, exact_float)
    check_limits(keys["rtol"], rtol, setting("rtol", kernel))
    outputs = _outputs(keys, kernel)
    design, axes, blocks = read_designs(keys, kernel)
    for name in (name for name in SETTINGS if name in keys and name in axes):
        keys[name].wrong(f"{name} is an axis as well; keep one of the two")
    fixed, follows = _complete(keys, kernel, axes, _fixed(keys, kernel, axes))
    along = _along(keys, kernel, outputs)
    if mistakes.good("fixed"):
        _check_methods(mistakes, kernel, axes, fixed, method, outputs)
    summary = None
    if "summary" in keys:
        together = [block.axes for block in blocks or [Block(design, tuple(axes))] if block.design != "product"]
        summary = _summary(keys, axes, together, [o for o in kernel.outputs if o.name in outputs])
        # those that are reduced come last
        axes = dict(sorted(axes.items(), key=lambda item: item[0] in summary.over))
    if where.strip():
        settings = [name for name in SETTINGS if name in axes]
        keys["where"].read(None, cells_where, kernel, settings, lambda name: np.zeros(0))
    mistakes.raise_if_any(source)
    return Study(
        title=title or f"{kernel.name} over {listed(axes, word='and')}",
        question=question,
        kernel_name=str(keys["kernel"].value),
        kernel=kernel,
        method=method,
        rtol=rtol,
        outputs=outputs,
        design=design,
        axes=axes,
        fixed=fixed,
        follows=follows,
        along=along,
        text=source_text,
        summary=summary,
        blocks=blocks,
        where=where.strip(),
    )


def _kernel(keys: Entry, source: str, allow_import: bool) -> Kernel:
    """The kernel, or the one that is meant. Raises StudyError where none is: nothing else can be checked then."""
    entry = keys["kernel"]
    if "kernel" not in keys:
        entry.wrong(f'missing; write e.g. kernel = "{next(iter(catalogue.KERNELS))}"')
    elif found := entry.read(None, load_kernel, allow_import, [keys.folder]):
        return found
    elif meant := nearest(entry.value, catalogue.KERNELS) if ":" not in str(entry.value) else "":
        return catalogue.get(meant)
    raise StudyError(source, keys.mistakes)


def _outputs(keys: Entry, kernel: Kernel) -> tuple[str, ...]:
    """Outputs asked for, in the kernel's order; where the study names none, those of its summary, or all."""
    names, asked = [o.name for o in kernel.outputs], list[str]()
    if "outputs" in keys:
        asked = keys["outputs"].words(names, "a list of outputs", "; leave it out to get all of them")
    else:
        summary = keys["summary"].value
        said = summary.get("outputs") if isinstance(summary, Mapping) else None
        asked = list(said) if said and isinstance(said, Mapping) and set(said) <= set(names) else names
    return tuple(name for name in names if name in asked)


def _fixed(keys: Entry, kernel: Kernel, axes: Mapping[str, Axis]) -> Fixed:
    """What the study fixes; a value outside of what its field declares would refuse every cell."""
    table, given = keys.table("fixed", "[fixed] with mu = 1.0"), Fixed()
    for name in table.value:
        entry = table[name]
        if name in SETTINGS:
            entry.wrong(f"belongs at the top of a study: {name} = ..., or under [axes.{name}]")
            continue
        if field := field_of(entry, name, kernel):
            before = len(keys.mistakes)
            given[name] = quantity(entry, field)
            if len(keys.mistakes) == before:
                check_limits(entry, given[name], field)
        if name in axes:
            entry.wrong(f"{name} is an axis as well; keep one of the two")
    return given


def _along(keys: Entry, kernel: Kernel, outputs: Sequence[str]) -> dict[str, Floats]:
    """Values of every coordinate of the kernel; none of those that no output asked for has."""
    table, mistakes = keys.table("along", "[along.phase] with num = 200"), keys.mistakes
    names = [c.name for c in kernel.along]
    for name in (name for name in table.value if name not in names):
        known = f"; it has {listed(names, word='and')}" if names else "; leave it out"
        mistakes.meant.add(table[name].unknown(name, names, f"kernel {kernel.name} has no such coordinate", known))
    needed = {dim: o.name for o in kernel.outputs if o.name in outputs for dim in o.dims}
    along: dict[str, Floats] = {}
    for field in kernel.along:
        entry, values = table[field.name], frozen([])
        if field.name not in table and field.default is not None:
            values = frozen(np.arange(field.lower, field.lower + float(field.default)))
        elif field.name in table:
            said = entry.value
            if isinstance(said, Mapping) and set(said) == {"num"} and math.isfinite(field.upper - field.lower):
                # from one limit to the other, or the first whole numbers
                counted = field.integer and isinstance(said["num"], int)
                last = min(field.upper, field.lower + said["num"] - 1) if counted else field.upper
                entry = replace(entry, value={"spacing": "linear", "start": field.lower, "stop": last, **said})
            before, values = len(mistakes), axis(entry, field).values
            if len(mistakes) == before:
                check_limits(entry, values, field, finite=True)
        elif field.name in needed and field.name not in mistakes.meant and not mistakes.unread:
            entry.wrong(f"missing; output {needed[field.name]} needs it, e.g. num = 200")
        along[field.name] = values if field.name in needed else frozen([])
    return along


def _complete(keys: Entry, kernel: Kernel, axes: Mapping[str, Axis], given: Fixed) -> tuple[Fixed, dict[str, str]]:
    """Every parameter that is no axis: its fixed value, its default, or the axis it follows."""
    mistakes, found, follows = keys.mistakes, Fixed(), dict[str, str]()
    for field in kernel.parameters:
        source = field
        while source.name not in axes and source.name not in given and isinstance(source.default, str):
            source = kernel.parameter(source.default)
        if source.name in axes:
            follows |= {} if source is field else {field.name: source.name}
        elif source.name in given:
            found[field.name] = given[source.name]
        elif isinstance(source.default, float | int):
            found[field.name] = float(source.default)
        elif source is field and field.name not in mistakes.meant and not mistakes.unread:
            what = f"{field.name} ({field.doc}, {field.unit}) has no default"
            mistakes.add(f"fixed.{field.name}", f"missing; {what}: give it here or as an axis")
    # array parameters of one length, single numbers repeated
    arrays = {p.name: p.dims[0] for p in kernel.parameters if p.dims}
    lengths = {name: axes[name].values.shape[-1] for name in arrays if name in axes and len(axes[name])}
    lengths |= {n: np.size(v) for n, v in found.items() if n in arrays and np.ndim(v) and np.size(v)}
    for dim in dict.fromkeys(arrays.values()):
        own = {name: n for name, n in lengths.items() if arrays[name] == dim}
        if len(set(own.values())) > 1:
            counts = listed((f"{name} has {n}" for name, n in own.items()), word="and")
            mistakes.add("fixed", f"arrays along {dim} need equal length; {counts} values")
        elif not own and mistakes.good("fixed") and not any(name in axes for name in arrays):
            mistakes.add("fixed", f"how many of {dim}? Give at least one of {listed(arrays)} as a list")
        for name in (name for name in arrays if arrays[name] == dim and not np.ndim(found.get(name, []))):
            found[name] = frozen(np.full(max(own.values(), default=1), found[name]))
    return found, follows


def _check_methods(
    mistakes: Mistakes, kernel: Kernel, axes: Mapping[str, Axis], fixed: Fixed, method: str, outputs: Sequence[str]
) -> None:
    """Methods named that cannot do a term which the study has, or do not give an output asked for."""
    where, words = "method", [method]
    if "method" in axes:
        where, words = "axes.method", sorted(set(axes["method"].words or ()))
    terms = [p.name for p in kernel.parameters if p.name in axes or differs(p, fixed)]
    excluded = {m.name: [term for term in m.excludes if term in terms] for m in kernel.methods}
    lacking = {m.name: [name for name in m.lacks if name in outputs] for m in kernel.methods}
    if "auto" in words and excluded and all(excluded.values()):
        hard = [term for term in terms if any(term in found for found in excluded.values())]
        together = " together" * (len(hard) > 1)
        mistakes.add(where, f"no method of {kernel.name} can do {listed(hard, word='and')}{together}")
    for wanting, verb, too, cure in (
        (excluded, "cannot do", "", "leave it out"),
        (lacking, "does not give", ", or name the outputs you want", "name other outputs"),
    ):
        able = [name for name, found in wanting.items() if not found]
        cure = f"use {listed(['auto', *able])}{too}" if able else cure
        for word in (word for word in words if wanting.get(word)):
            mistakes.add(where, f"{word} {verb} {listed(wanting[word], word='and')}; {cure}")


def _summary(
    keys: Entry, axes: Mapping[str, Axis], together: Sequence[Sequence[str]], asked: Sequence[Field]
) -> Summary:
    """What is kept instead of every cell, of the output fields asked for; `together` are axes that run together.

    [summary]
    over = ["mu"]                                             # axes to reduce; default: all
    outputs.period = ["min", "mean", "argmin", "histogram"]   # default: all that need no edges, of every output

    [summary.edges.period]                                    # of the histogram's bins, written like an axis
    spacing = "log"
    start = 1e-3
    stop = 1e3
    num = 61
    """
    table = keys.table("summary", 'summary.over = ["mu"]').keys("over", "outputs", "edges")
    over = tuple(axes)
    if axes and table["over"].value is not None:
        example = 'a list of axes, e.g. ["mu"]; leave it out to reduce all'
        named = table["over"].words([*axes, *(keys.mistakes.meant - {""})], example)
        over = tuple(name for name in axes if name in named)
        for block in (block for block in together if len({name in named for name in block}) > 1):
            cure = f"{listed(block, word='and')} run together and are reduced together; name all of them, or none"
            table["over"].wrong(cure)
    fields = {field.name: field for field in asked}
    outputs: dict[str, tuple[str, ...]] = dict.fromkeys(fields, REDUCTIONS[:-1])
    given = table.table("outputs", 'outputs.period = ["min", "max"]')
    for name in given.value:
        if asked and name not in fields:
            there = f"; there are {listed(fields, word='and')}"
            given[name].unknown(name, fields, "is none of the outputs asked for", there)
        words = given[name].words(REDUCTIONS, 'a list of reductions, e.g. ["min", "max"]')
        if name in fields:
            outputs[name] = tuple(r for r in REDUCTIONS if r in words)
    edges = _edges(table, outputs, fields)
    # reductions of one output may be called as another output, or as an axis
    called = [name for output, reductions in outputs.items() for name in names(output, reductions, over)]
    if twice := sorted({name for name in called if called.count(name) > 1} | (set(called) & set(axes))):
        table["outputs"].wrong(f"two variables would be called {listed(twice)}; ask for one of them")
    return Summary(over, outputs, edges)


def _edges(table: Entry, outputs: Mapping[str, Sequence[str]], fields: Mapping[str, Field]) -> dict[str, Floats]:
    """Bounds of the bins of every histogram."""
    given, edges = table.table("edges", "[summary.edges.period] with num = 61"), dict[str, Floats]()
    if not table.mistakes.good("outputs", "summary.outputs", "summary.edges"):
        return {}
    wanted = [name for name, reductions in outputs.items() if "histogram" in reductions]
    for name in given.value:
        if name in wanted:
            # numbers also where the output is an array
            edges[name] = values = axis(given[name], Field(name, fields[name].unit, "")).values
            if len(values) == 1:
                given[name].wrong("expected at least 2 edges, found 1")
            elif len(values) and not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
                given[name].wrong("expected finite edges, each larger than the one before")
        else:
            cure = f'; ask for it: outputs.{name} = ["histogram"]' if name in outputs else did_you_mean(name, wanted)
            given[name].wrong(f"there is no histogram of {name}{cure}")
            wanted = [meant for meant in wanted if meant != nearest(name, wanted)]
    for name in (name for name in wanted if name not in given.value):
        entry = '{ spacing = "log", start = 1e-3, stop = 1e3, num = 61 }'
        given[name].wrong(f"missing; its histogram needs them, e.g. {entry}")
    return edges


def names(output: str, reductions: Sequence[str], over: Sequence[str]) -> list[str]:
    """What the reductions of an output are called in the result."""
    found = [f"{output}_count"]
    for reduction in reductions:
        parts = [reduction]
        if reduction in ("argmin", "argmax"):
            parts = [f"{reduction}_{name}" for name in (*over, "status")]
        elif reduction == "histogram":
            parts = ["histogram", "below", "above"]
        found += [f"{output}_{part}" for part in parts]
    return found
