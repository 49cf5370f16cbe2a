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
from typing import Any

import numpy as np

from kernels.interface import Field
from sweep.study.entries import Entries
from sweep.study.model import Axis, Summary
from sweep.study.spacing import Floats
from sweep.words import did_you_mean, listed, nearest

REDUCTIONS = ("min", "max", "mean", "argmin", "argmax", "histogram")
WITHOUT_EDGES = REDUCTIONS[:-1]


def read_summary(
    found: Any, axes: Mapping[str, Axis], together: Sequence[Sequence[str]], asked: Sequence[Field], entries: Entries
) -> Summary:
    """The summary that a table says, of the output fields asked for; `together` are axes that run together."""
    mistakes = entries.mistakes
    table = mistakes.table(found, "summary", 'summary.over = ["mu"]')
    table = mistakes.keys(table, ("over", "outputs", "edges"), "summary")
    over = tuple(axes)
    if axes and table.get("over") is not None:
        known, example = [*axes, *mistakes.meant], 'a list of axes, e.g. ["mu"]; leave it out to reduce all'
        named = mistakes.words(table["over"], "summary.over", known, example)
        over = tuple(name for name in axes if name in named)
        for block in (block for block in together if len({name in named for name in block}) > 1):
            cure = f"{listed(block, word='and')} run together and are reduced together; name all of them, or none"
            mistakes.add("summary.over", cure)
    outputs = _outputs(table.get("outputs", {}), [f.name for f in asked], entries)
    edges = _edges(table.get("edges", {}), outputs, entries, {f.name: f for f in asked})
    # reductions of one output may be called as another output, or as an axis
    named = [name for output, reductions in outputs.items() for name in names(output, reductions, over)]
    twice = sorted({name for name in named if named.count(name) > 1} | (set(named) & set(axes)))
    if twice:
        mistakes.add("summary.outputs", f"two variables would be called {listed(twice)}; ask for one of them")
    return Summary(over, outputs, edges)


def _outputs(found: Any, asked: Sequence[str], entries: Entries) -> dict[str, tuple[str, ...]]:
    """Reductions of every output asked for."""
    where, words = "summary.outputs", {}
    for name, given in entries.mistakes.table(found, where, 'outputs.period = ["min", "max"]').items():
        if asked and name not in asked:
            hint = did_you_mean(name, asked) or f"; there are {listed(asked, word='and')}"
            entries.mistakes.add(f"{where}.{name}", f"is none of the outputs asked for{hint}")
        example = 'a list of reductions, e.g. ["min", "max"]'
        words[name] = entries.mistakes.words(given, f"{where}.{name}", REDUCTIONS, example)
    return {name: tuple(r for r in REDUCTIONS if r in words.get(name, WITHOUT_EDGES)) for name in asked}


def _edges(
    found: Any, outputs: Mapping[str, Sequence[str]], entries: Entries, fields: Mapping[str, Field]
) -> dict[str, Floats]:
    """Bounds of the bins of every histogram."""
    mistakes, edges = entries.mistakes, {}
    given = mistakes.table(found, "summary.edges", "[summary.edges.period] with num = 61")
    wanted = [name for name, reductions in outputs.items() if "histogram" in reductions]
    if not mistakes.good("outputs", "summary.outputs", "summary.edges"):
        return {}
    for name, entry in given.items():
        where = f"summary.edges.{name}"
        if name not in wanted:
            cure = f'; ask for it: outputs.{name} = ["histogram"]' if name in outputs else did_you_mean(name, wanted)
            mistakes.add(where, f"there is no histogram of {name}{cure}")
            wanted = [meant for meant in wanted if meant != nearest(name, wanted)]
            continue
        # numbers also where the output is an array
        field = Field(name, fields[name].unit, "")
        edges[name] = values = entries.axis(name, entry, field, where).values
        if len(values) == 1:
            mistakes.add(where, "expected at least 2 edges, found 1")
        if len(values) > 1 and not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
            mistakes.add(where, "expected finite edges, each larger than the one before")
    for name in (name for name in wanted if name not in given):
        entry = '{ spacing = "log", start = 1e-3, stop = 1e3, num = 61 }'
        mistakes.add(f"summary.edges.{name}", f"missing; its histogram needs them, e.g. {entry}")
    return edges


def names(output: str, reductions: Sequence[str], over: Sequence[str]) -> list[str]:
    """What the reductions of an output are called in the result."""
    found = [f"{output}_count"]
    for reduction in reductions:
        if reduction in ("argmin", "argmax"):
            found += [f"{output}_{reduction}_{name}" for name in (*over, "status")]
        elif reduction == "histogram":
            found += [f"{output}_{part}" for part in ("histogram", "below", "above")]
        else:
            found.append(f"{output}_{reduction}")
    return found
