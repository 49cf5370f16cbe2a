"""From the keys of a study to a checked `Study`: what each key may be, and what must fit together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kernels import catalogue
from kernels.interface import Field, Kernel
from sweep.errors import StudyError, SweepError
from sweep.study.condition import CellCondition
from sweep.study.designs import axes_named, read_designs
from sweep.study.entries import Entries
from sweep.study.kernel_lookup import load_kernel
from sweep.study.mistakes import Mistakes, exact_float, limits
from sweep.study.model import SETTINGS, SMALLEST_RTOL, Axis, Block, Study, differs, frozen, setting
from sweep.study.spacing import Floats
from sweep.study.summary import read_summary
from sweep.words import did_you_mean, listed, nearest

KEYS = (
    "title", "question", "kernel", "method", "rtol", "outputs", "design", "axes", "blocks", "where", "fixed", "along",
    "summary",
)  # fmt: skip

DEFAULT_RTOL = 1e-9
Fixed = dict[str, float | Floats]


class StudyParser:
    """Turns the keys of one study into a `Study`; mistakes gather on the way and are raised together."""

    def __init__(self, source: str, folder: Path, allow_import: bool) -> None:
        self.source, self.folder, self.allow_import = source, folder, allow_import
        self.mistakes = Mistakes()
        self.entries = Entries(self.mistakes, folder)

    def study(self, keys: Mapping[str, Any], text: str) -> Study:
        """The study. Raises StudyError with all that is wrong with it."""
        mistakes, keys = self.mistakes, self.mistakes.keys(keys, KEYS)
        self.kernel = self._kernel(keys)
        title, question = (mistakes.text(keys.get(key, ""), key) for key in ("title", "question"))
        method, rtol = self._settings(keys)
        outputs = self._outputs(keys)
        design, axes, blocks = read_designs(keys, self.entries, self._field)
        given = self._fixed(keys.get("fixed", {}), axes)
        along = self._along(keys.get("along", {}), outputs)
        fixed, follows = self._complete(axes, given)
        self._check_methods(method, axes, fixed, outputs)
        summary = None
        if "summary" in keys:
            together = [block.axes for block in blocks or [Block(design, tuple(axes))] if block.design != "product"]
            asked = [o for o in self.kernel.outputs if o.name in outputs]
            summary = read_summary(keys["summary"], axes, together, asked, self.entries)
            # those that are reduced come last
            axes = dict(sorted(axes.items(), key=lambda item: item[0] in summary.over))
        where = mistakes.text(keys.get("where", ""), "where").strip()
        if where:
            names = [name for name in SETTINGS if name in axes]
            mistakes.tried("where", lambda: CellCondition(where, self.kernel, names), None)
        mistakes.raise_if_any(self.source)
        return Study(
            title=title or f"{self.kernel.name} over {listed(axes, word='and')}",
            question=question,
            kernel_name=str(keys["kernel"]),
            kernel=self.kernel,
            method=method,
            rtol=rtol,
            outputs=outputs,
            design=design,
            axes=axes,
            fixed=fixed,
            follows=follows,
            along=along,
            text=text,
            summary=summary,
            blocks=blocks,
            where=where,
        )

    def _kernel(self, keys: Mapping[str, Any]) -> Kernel:
        """The kernel, or the one that is meant. Raises StudyError where none is: nothing else can be checked then."""
        name = keys.get("kernel")
        try:
            if "kernel" in keys:
                return load_kernel(name, self.allow_import, [self.folder])
            self.mistakes.add("kernel", f'missing; write e.g. kernel = "{next(iter(catalogue.KERNELS))}"')
        except SweepError as error:
            self.mistakes.add("kernel", str(error))
            if meant := nearest(name, catalogue.KERNELS) if ":" not in str(name) else "":
                return catalogue.get(meant)
        raise StudyError(self.source, self.mistakes.found)

    def _settings(self, keys: Mapping[str, Any]) -> tuple[str, float]:
        """Method and rtol, each given once: here or as an axis."""
        mistakes, method, rtol = self.mistakes, "auto", DEFAULT_RTOL
        for name in (name for name in SETTINGS if name in keys and name in axes_named(keys)):
            mistakes.add(name, f"{name} is an axis as well; keep one of the two")
        if "method" in keys:
            method = mistakes.word(keys["method"], "method", setting("method", self.kernel).choices) or "auto"
        if "rtol" in keys:
            before = len(mistakes)
            rtol = mistakes.tried("rtol", lambda: exact_float(keys["rtol"]), math.nan)
            if not SMALLEST_RTOL <= rtol < 1 and len(mistakes) == before:
                mistakes.add("rtol", f"expected {SMALLEST_RTOL:g} <= rtol < 1, found {rtol:g}")
        return method, rtol

    def _outputs(self, keys: Mapping[str, Any]) -> tuple[str, ...]:
        """Outputs asked for, in the kernel's order; where the study names none, those of its summary, or all."""
        names = [o.name for o in self.kernel.outputs]
        if "outputs" in keys:
            cure = "; leave it out to get all of them"
            asked: Any = self.mistakes.words(keys["outputs"], "outputs", names, "a list of outputs", cure)
        else:
            summary = keys.get("summary")
            asked = summary.get("outputs") if isinstance(summary, Mapping) else None
            if not asked or not isinstance(asked, Mapping) or not set(asked) <= set(names):
                asked = names
        return tuple(name for name in names if name in asked)

    def _field(self, name: str, where: str) -> Field | None:
        """What may be an axis: a parameter, method or rtol. A mistake where it is none, and what it is taken for."""
        known = {p.name: p for p in self.kernel.parameters}
        if name in SETTINGS:
            return setting(name, self.kernel)
        if name not in known:
            hint = did_you_mean(name, [*known, *SETTINGS]) or f"; it has {listed(known, word='and')}"
            self.mistakes.add(where, f"kernel {self.kernel.name} has no such parameter{hint}")
            name = nearest(name, known)
            self.mistakes.meant.add(name)
        return known.get(name)

    def _fixed(self, found: Any, axes: Mapping[str, Axis]) -> Fixed:
        """What the study fixes; a value outside of what its field declares would refuse every cell."""
        given: Fixed = {}
        for name, entry in self.mistakes.table(found, "fixed", "[fixed] with mu = 1.0").items():
            where = f"fixed.{name}"
            if name in SETTINGS:
                self.mistakes.add(where, f"stands at the top of a study: {name} = ..., or under [axes.{name}]")
                continue
            field, before = self._field(name, where), len(self.mistakes)
            given[name] = self.entries.quantity(entry, field, where) if field else math.nan
            if field and len(self.mistakes) == before:
                values = np.atleast_1d(given[name])
                inside = (values > field.lower if field.open_lower else values >= field.lower) & (values <= field.upper)
                inside &= (np.round(values) == values) | (not field.integer)
                bad = values[~inside & (values != field.default)]
                if len(bad):
                    unit = f" {field.unit}" if field.unit != "1" else ""
                    wanted = f"{'a whole number ' * field.integer}{limits(field) or 'a number'}{unit}"
                    self.mistakes.add(where, f"expected {wanted}, found {bad[0]:.6g}{unit}")
            if name in axes:
                self.mistakes.add(where, f"{name} is an axis as well; keep one of the two")
        return given

    def _along(self, found: Any, outputs: tuple[str, ...]) -> dict[str, Floats]:
        """Values of every coordinate of the kernel; none of those that no output asked for has."""
        mistakes = self.mistakes
        given = mistakes.table(found, "along", "[along.phase] with num = 200")
        names = [c.name for c in self.kernel.along]
        for name in (name for name in given if name not in names):
            known = f"; it has {listed(names, word='and')}" if names else "; leave it out"
            hint = did_you_mean(name, names) or known
            mistakes.add(f"along.{name}", f"kernel {self.kernel.name} has no such coordinate{hint}")
            mistakes.meant.add(nearest(name, names))
        needed = {dim: o.name for o in self.kernel.outputs if o.name in outputs for dim in o.dims}
        along: dict[str, Floats] = {}
        for field in self.kernel.along:
            where, before, values = f"along.{field.name}", len(mistakes), frozen([])
            if field.name in given:
                entry = given[field.name]
                if isinstance(entry, Mapping) and set(entry) == {"num"} and math.isfinite(field.upper - field.lower):
                    # from one limit to the other, or the first whole numbers
                    counted = field.integer and isinstance(entry["num"], int)
                    last = min(field.upper, field.lower + entry["num"] - 1) if counted else field.upper
                    entry = {"spacing": "linear", "start": field.lower, "stop": last, **entry}
                values = self.entries.axis(field.name, entry, field, where).values
                inside = (values >= field.lower) & (values <= field.upper) & np.isfinite(values)
                bad = values[~(inside & ((values == np.round(values)) | (not field.integer)))]
                if len(bad) and len(mistakes) == before:
                    kind = "whole numbers" if field.integer else "values"
                    text = f"expected {kind} from {field.lower:g} to {field.upper:g}, found {bad[0]:g}"
                    mistakes.add(where, text)
            elif field.name in needed and field.name not in mistakes.meant and not mistakes.unread:
                mistakes.add(where, f"missing; output {needed[field.name]} needs it, e.g. num = 200")
            along[field.name] = values if field.name in needed else frozen([])
        return along

    def _complete(self, axes: Mapping[str, Axis], given: Fixed) -> tuple[Fixed, dict[str, str]]:
        """Every parameter that is no axis: its fixed value, its default, or the axis it follows."""
        mistakes = self.mistakes
        fixed: Fixed = {}
        follows: dict[str, str] = {}
        for field in self.kernel.parameters:
            source = field
            while source.name not in axes and source.name not in given and isinstance(source.default, str):
                source = self.kernel.parameter(source.default)
            if source.name in axes:
                follows |= {} if source is field else {field.name: source.name}
            elif source.name in given:
                fixed[field.name] = given[source.name]
            elif isinstance(source.default, float | int):
                fixed[field.name] = float(source.default)
            elif source is field and field.name not in mistakes.meant and not mistakes.unread:
                what = f"{field.name} ({field.doc}, {field.unit}) has no default"
                mistakes.add(f"fixed.{field.name}", f"missing; {what}: give it here or as an axis")
        # array parameters of one length, single numbers repeated
        arrays = {p.name: p.dims[0] for p in self.kernel.parameters if p.dims}
        lengths = {name: axes[name].values.shape[-1] for name in arrays if name in axes and len(axes[name])}
        lengths |= {n: np.size(v) for n, v in fixed.items() if n in arrays and np.ndim(v) and np.size(v)}
        for dim in dict.fromkeys(arrays.values()):
            found = {name: n for name, n in lengths.items() if arrays[name] == dim}
            if len(set(found.values())) > 1:
                counts = listed((f"{name} has {n}" for name, n in found.items()), word="and")
                mistakes.add("fixed", f"arrays along {dim} need equal length; {counts} values")
            elif not found and mistakes.good("fixed") and not any(name in axes for name in arrays):
                mistakes.add("fixed", f"how many of {dim}? Give at least one of {listed(arrays)} as a list")
            for name in (name for name in arrays if arrays[name] == dim and not np.ndim(fixed.get(name, []))):
                fixed[name] = frozen(np.full(max(found.values(), default=1), fixed[name]))
        return fixed, follows

    def _check_methods(self, method: str, axes: Mapping[str, Axis], fixed: Fixed, outputs: Sequence[str]) -> None:
        """Methods named that cannot do a term which the study has, or do not give an output asked for."""
        if not self.mistakes.good("fixed"):
            return
        where, words = "method", [method]
        if "method" in axes:
            where, words = "axes.method", sorted(set(axes["method"].words or ()))
        terms = [p.name for p in self.kernel.parameters if p.name in axes or differs(p, fixed)]
        excluded = {m.name: [term for term in m.excludes if term in terms] for m in self.kernel.methods}
        lacking = {m.name: [name for name in m.lacks if name in outputs] for m in self.kernel.methods}
        if "auto" in words and excluded and all(excluded.values()):
            hard = [term for term in terms if any(term in found for found in excluded.values())]
            self.mistakes.add(where, f"no method of {self.kernel.name} can do {listed(hard, word='and')} together")
        for wanting, verb, too, cure in (
            (excluded, "cannot do", "", "leave it out"),
            (lacking, "does not give", ", or name the outputs you want", "name other outputs"),
        ):
            able = [name for name, found in wanting.items() if not found]
            cure = f"use {listed(['auto', *able])}{too}" if able else cure
            for word in (word for word in words if wanting.get(word)):
                self.mistakes.add(where, f"{word} {verb} {listed(wanting[word], word='and')}; {cure}")
