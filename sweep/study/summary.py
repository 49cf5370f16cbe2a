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
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels.interface import Field
from sweep.study.field_parser import FieldParser
from sweep.study.mistakes import Mistakes, did_you_mean, listed, nearest
from sweep.study.model import Axis, Summary

REDUCTIONS = ("min", "max", "mean", "argmin", "argmax", "histogram")
WITHOUT_EDGES = REDUCTIONS[:-1]
KEYS = ("over", "outputs", "edges")
Together = Sequence[Sequence[str]]


@dataclass
class SummaryParser:
    """Reads `[summary]` of one study; what is wrong goes to the mistakes of `fields`."""

    fields: FieldParser

    @property
    def mistakes(self) -> Mistakes:
        """Where mistakes gather."""
        return self.fields.mistakes

    def read(self, found: Any, axes: Mapping[str, Axis], together: Together, asked: Sequence[Field]) -> Summary:
        """The summary that the table says, of the output fields asked for; `together` are axes that run together."""
        table = self.mistakes.table(found, "summary", 'summary.over = ["mu"]')
        table = self.mistakes.keys(table, KEYS, "summary")
        over = self._over(table.get("over"), axes, together)
        outputs = self._outputs(table.get("outputs", {}), [f.name for f in asked])
        edges = self._edges(table.get("edges", {}), outputs, {f.name: f for f in asked})
        self._names(over, outputs, axes)
        return Summary(over, outputs, edges)

    def _over(self, found: Any, axes: Mapping[str, Axis], together: Together) -> tuple[str, ...]:
        """Axes that are reduced, in the study's order."""
        if found is None:
            return tuple(axes)
        where = "summary.over"
        if not axes:
            return ()
        known = [*axes, *self.mistakes.meant]
        names = self.mistakes.words(found, where, known, 'a list of axes, e.g. ["mu"]; leave it out to reduce all')
        for block in together:
            if len({name in names for name in block}) > 1:
                listing = listed(block, word="and")
                self.mistakes.add(where, f"{listing} run together and are reduced together; name all of them, or none")
        return tuple(name for name in axes if name in names)

    def _outputs(self, found: Any, asked: Sequence[str]) -> dict[str, tuple[str, ...]]:
        given = self.mistakes.table(found, "summary.outputs", 'outputs.period = ["min", "max"]')
        for name in given:
            if asked and name not in asked:
                hint = did_you_mean(name, asked) or f"; there are {listed(asked, word='and')}"
                self.mistakes.add(f"summary.outputs.{name}", f"is none of the outputs asked for{hint}")
        example = 'a list of reductions, e.g. ["min", "max"]'
        where = "summary.outputs"
        words = {n: self.mistakes.words(w, f"{where}.{n}", REDUCTIONS, example) for n, w in given.items()}
        return {name: tuple(r for r in REDUCTIONS if r in words.get(name, WITHOUT_EDGES)) for name in asked}

    def _edges(
        self, found: Any, outputs: Mapping[str, Sequence[str]], fields: Mapping[str, Field]
    ) -> dict[str, NDArray[np.float64]]:
        given = self.mistakes.table(found, "summary.edges", "[summary.edges.period] with num = 61")
        wanted = [name for name, reductions in outputs.items() if "histogram" in reductions]
        edges = {}
        if not self.mistakes.good("kernel", "outputs", "summary.outputs", "summary.edges"):
            return {}
        for name, entry in given.items():
            where = f"summary.edges.{name}"
            if name not in wanted:
                cure = (
                    f'; ask for it: outputs.{name} = ["histogram"]' if name in outputs else did_you_mean(name, wanted)
                )
                self.mistakes.add(where, f"there is no histogram of {name}{cure}")
                wanted = [meant for meant in wanted if meant != nearest(name, wanted)]
                continue
            edges[name] = self.fields.axis(name, entry, _plain(fields[name]), where).values
            self._rising(edges[name], where)
        for name in wanted:
            if name not in given:
                entry = '{ spacing = "log", start = 1e-3, stop = 1e3, num = 61 }'
                self.mistakes.add(f"summary.edges.{name}", f"missing; its histogram needs them, e.g. {entry}")
        return edges

    def _rising(self, edges: NDArray[np.float64], where: str) -> None:
        """Edges that have a mistake already are empty."""
        if len(edges) == 1:
            self.mistakes.add(where, "expected at least 2 edges, found 1")
        if len(edges) > 1 and not (np.isfinite(edges).all() and (np.diff(edges) > 0).all()):
            self.mistakes.add(where, "expected finite edges, each larger than the one before")

    def _names(self, over: Sequence[str], outputs: Mapping[str, Sequence[str]], axes: Mapping[str, Axis]) -> None:
        """Reductions of one output may be called as another output, or as an axis."""
        counts = [n for output, reductions in outputs.items() for n in names(output, reductions, over)]
        twice = sorted({n for n in counts if counts.count(n) > 1} | (set(counts) & set(axes)))
        if twice:
            self.mistakes.add("summary.outputs", f"two variables would be called {listed(twice)}; ask for one of them")


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


def _plain(field: Field) -> Field:
    """The field as one number: edges are numbers also where the output is an array."""
    return Field(field.name, field.unit, field.doc)
