"""What a study keeps of its cells where it does not keep each of them: `[summary]`.

[summary]
over = ["mu"]                                             # axes to reduce; default: all
outputs.period = ["min", "mean", "argmin", "histogram"]   # default: all that need no edges, of every output

[summary.edges.period]                                    # of the histogram's bins, written like an axis
spacing = "log"
start = 1e-3
stop = 1e3
num = 61
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kernels.interface import Field
from sweep.study.mistakes import Entry
from sweep.study.model import Axis, Summary
from sweep.study.values import Floats, axis
from sweep.words import did_you_mean, listed, nearest

REDUCTIONS = ("min", "max", "mean", "argmin", "argmax", "histogram")


def read_summary(
    keys: Entry, axes: Mapping[str, Axis], together: Sequence[Sequence[str]], asked: Sequence[Field]
) -> Summary:
    """The summary that a table says, of the output fields asked for; `together` are axes that run together."""
    table = keys.table("summary", 'summary.over = ["mu"]').keys("over", "outputs", "edges")
    over = tuple(axes)
    if axes and table["over"].value is not None:
        example = 'a list of axes, e.g. ["mu"]; leave it out to reduce all'
        named = table["over"].words([*axes, *keys.mistakes.meant], example)
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
