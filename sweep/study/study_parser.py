"""From the keys of a study to a checked `Study`: what each key may be, and what must fit together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kernels import catalogue
from kernels.interface import Field, Kernel
from sweep.errors import SweepError
from sweep.study.condition import CellCondition
from sweep.study.designs import SMALLEST_RTOL, DesignParser, axes_named
from sweep.study.field_parser import FieldParser
from sweep.study.kernel_lookup import load_kernel
from sweep.study.mistakes import Mistakes, did_you_mean, limits, listed, nearest
from sweep.study.model import AUTO, SETTINGS, Axis, Block, Study, Summary, differs, frozen
from sweep.study.summary import SummaryParser

KEYS = (
    "title", "question", "kernel", "method", "rtol", "outputs", "design", "axes", "blocks", "where", "fixed", "along",
    "summary",
)  # fmt: skip

DEFAULT_RTOL = 1e-9
UNKNOWN = Kernel("?", "", "", (), (), lambda *columns: None, ())
"""Stands for a kernel that could not be found, so that the rest of a study is checked all the same."""


class StudyParser:
    """Turns the keys of one study into a `Study`; mistakes gather on the way and are raised together."""

    def __init__(self, source: str, folder: Path, allow_import: bool) -> None:
        self.source, self.folder, self.allow_import = source, folder, allow_import
        self.mistakes = Mistakes()
        self.fields = FieldParser(self.mistakes, folder)
        self.kernel = UNKNOWN

    def study(self, keys: Mapping[str, Any], text: str) -> Study:
        """The study. Raises StudyError with all that is wrong with it."""
        keys = self.mistakes.keys(keys, KEYS)
        self.kernel = self._kernel(keys)
        title, question = (self.mistakes.text(keys.get(key, ""), key) for key in ("title", "question"))
        method, rtol = self._method(keys), self._rtol(keys)
        outputs = self._outputs(keys.get("outputs", self._named(keys.get("summary"))))
        design, axes, blocks = DesignParser(self.fields, self._axis_field).read(keys)
        given = self._fixed(keys.get("fixed", {}), axes)
        along = self._along(keys.get("along", {}), outputs)
        fixed, follows = self._complete(axes, given)
        self._check_methods(method, axes, fixed, outputs)
        summary = self._summary(keys, axes, design, blocks, outputs)
        axes = _kept_first(axes, summary)
        where = self._where(keys, axes)
        self.mistakes.raise_if_any(self.source)
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

    def _summary(
        self,
        keys: Mapping[str, Any],
        axes: Mapping[str, Axis],
        design: str,
        blocks: Sequence[Block],
        outputs: tuple[str, ...],
    ) -> Summary | None:
        if "summary" not in keys:
            return None
        asked = [o for o in self.kernel.outputs if o.name in outputs]
        together = [block.axes for block in blocks or [Block(design, tuple(axes))] if block.design != "product"]
        return SummaryParser(self.fields).read(keys["summary"], axes, together, asked)

    def _where(self, keys: Mapping[str, Any], axes: Mapping[str, Axis]) -> str:
        """The condition on the cells, which can be read and compares like with like."""
        text = self.mistakes.text(keys.get("where", ""), "where").strip()
        if text and self.kernel is not UNKNOWN:
            try:
                CellCondition(text, self.kernel, [name for name in SETTINGS if name in axes])
            except SweepError as error:
                self.mistakes.add("where", str(error))
        return text

    def _axis_field(self, name: str, where: str) -> Field | None:
        """What may be an axis: a parameter, method or rtol."""
        return self._setting(name) if name in SETTINGS else self._field(name, where)

    def _kernel(self, keys: Mapping[str, Any]) -> Kernel:
        if "kernel" not in keys:
            self.mistakes.add("kernel", f'missing; write e.g. kernel = "{next(iter(catalogue.KERNELS))}"')
            return UNKNOWN
        try:
            return load_kernel(keys["kernel"], self.allow_import, [self.folder])
        except SweepError as error:
            self.mistakes.add("kernel", str(error))
            return UNKNOWN

    def _field(self, name: str, where: str) -> Field | None:
        """The kernel's parameter `name`, or a mistake."""
        found = next((p for p in self.kernel.parameters if p.name == name), None)
        if found is None and self.kernel is not UNKNOWN:
            names = [p.name for p in self.kernel.parameters]
            hint = did_you_mean(name, [*names, *SETTINGS]) or f"; it has {listed(names, word='and')}"
            self.mistakes.add(where, f"kernel {self.kernel.name} has no such parameter{hint}")
            self.mistakes.meant.add(nearest(name, names))
        return found

    def _setting(self, name: str) -> Field | None:
        """Method or rtol as a field: what may be an axis although it is no parameter."""
        if name == "rtol":
            return Field("rtol", "1", "wanted relative error", lower=SMALLEST_RTOL, upper=1.0)
        if self.kernel is UNKNOWN:
            return None
        choices = {"auto": AUTO} | {m.name: i for i, m in enumerate(self.kernel.methods)}
        return Field("method", "1", "how a cell is solved", choices=choices)

    def _method(self, keys: Mapping[str, Any]) -> str:
        field = self._setting("method")
        if "method" not in keys or field is None:
            return "auto"
        self._only_once("method", keys)
        return self.mistakes.word(keys["method"], "method", field.choices) or "auto"

    def _rtol(self, keys: Mapping[str, Any]) -> float:
        self._only_once("rtol", keys)
        before = len(self.mistakes)
        rtol = self.mistakes.number(keys.get("rtol", DEFAULT_RTOL), "rtol")
        if not SMALLEST_RTOL <= rtol < 1 and len(self.mistakes) == before:
            self.mistakes.add("rtol", f"expected {SMALLEST_RTOL:g} <= rtol < 1, found {rtol:g}")
        return rtol

    def _only_once(self, name: str, keys: Mapping[str, Any]) -> None:
        if name in keys and name in axes_named(keys):
            self.mistakes.add(name, f"{name} is an axis as well; keep one of the two")

    def _named(self, summary: Any) -> list[str] | None:
        """Outputs that the summary names, which are those asked for where the study does not say."""
        found = summary.get("outputs") if isinstance(summary, Mapping) else None
        known = [o.name for o in self.kernel.outputs]
        if not isinstance(found, Mapping) or not set(found) <= set(known):
            return None
        return [name for name in known if name in found] or None

    def _outputs(self, found: Any) -> tuple[str, ...]:
        """Outputs asked for, in the kernel's order; all of them where the study names none."""
        names = [o.name for o in self.kernel.outputs]
        if found is None:
            return tuple(names)
        allowed, cure = None if self.kernel is UNKNOWN else names, "; leave it out to get all of them"
        asked = self.mistakes.words(found, "outputs", allowed, "a list of outputs", cure)
        return tuple(name for name in names if name in asked)

    def _fixed(self, found: Any, axes: Mapping[str, Axis]) -> dict[str, float | NDArray[np.float64]]:
        given = {}
        for name, entry in self.mistakes.table(found, "fixed", "[fixed] with mu = 1.0").items():
            where = f"fixed.{name}"
            if name in SETTINGS:
                self.mistakes.add(where, f"stands at the top of a study: {name} = ..., or under [axes.{name}]")
                continue
            before = len(self.mistakes)
            field = self._field(name, where)
            given[name] = self.fields.quantity(entry, field, where)
            if field is not None:
                self._check_limits(field, given[name], before, where)
            if name in axes:
                self.mistakes.add(where, f"{name} is an axis as well; keep one of the two")
        return given

    def _check_limits(self, field: Field, given: float | NDArray[np.float64], before: int, where: str) -> None:
        """A fixed value outside of what its field declares would refuse every cell; its default is always allowed."""
        values = np.atleast_1d(given)
        inside = (values > field.lower if field.open_lower else values >= field.lower) & (values <= field.upper)
        bad = values[~(inside & (np.round(values) == values) if field.integer else inside) & (values != field.default)]
        if len(bad) and len(self.mistakes) == before:
            unit = f" {field.unit}" if field.unit != "1" else ""
            kind = "a whole number " * field.integer
            self.mistakes.add(where, f"expected {kind}{limits(field) or 'a number'}{unit}, found {bad[0]:.6g}{unit}")

    def _complete(
        self, axes: Mapping[str, Axis], given: Mapping[str, float | NDArray[np.float64]]
    ) -> tuple[dict[str, float | NDArray[np.float64]], dict[str, str]]:
        """Every parameter that is no axis: its fixed value, or the axis it follows."""
        fixed: dict[str, float | NDArray[np.float64]] = {}
        follows: dict[str, str] = {}
        for field in self.kernel.parameters:
            source = self._source(field, axes, given)
            if source.name in axes:
                if source is not field:
                    follows[field.name] = source.name
            elif source.name in given:
                fixed[field.name] = given[source.name]
            elif isinstance(source.default, float | int):
                fixed[field.name] = float(source.default)
            elif source is field and field.name not in self.mistakes.meant and not self.mistakes.unread:
                what = f"{field.name} ({field.doc}, {field.unit}) has no default"
                self.mistakes.add(f"fixed.{field.name}", f"missing; {what}: give it here or as an axis")
        return self._filled(axes, fixed), follows

    def _filled(
        self, axes: Mapping[str, Axis], fixed: dict[str, float | NDArray[np.float64]]
    ) -> dict[str, float | NDArray[np.float64]]:
        """Array parameters of one length, single numbers repeated; mistakes where their lengths differ."""
        arrays = {p.name: p.dims[0] for p in self.kernel.parameters if p.dims}
        lengths = {name: axes[name].values.shape[-1] for name in arrays if name in axes and len(axes[name])}
        lengths |= {
            name: np.size(fixed[name]) for name in arrays if np.ndim(fixed.get(name, 0.0)) and np.size(fixed[name])
        }
        for dim in dict.fromkeys(arrays.values()):
            found = {name: n for name, n in lengths.items() if arrays[name] == dim}
            if len(set(found.values())) > 1:
                counts = listed((f"{name} has {n}" for name, n in found.items()), word="and")
                self.mistakes.add("fixed", f"arrays along {dim} need equal length; {counts} values")
            elif not found and self.mistakes.good("fixed") and not any(name in axes for name in arrays):
                self.mistakes.add("fixed", f"how many of {dim}? Give at least one of {listed(arrays)} as a list")
            for name in arrays:
                if arrays[name] == dim and name in fixed and not np.ndim(fixed[name]):
                    fixed[name] = frozen(np.full(max(found.values(), default=1), fixed[name]))
        return fixed

    def _source(self, field: Field, axes: Mapping[str, Axis], given: Mapping[str, Any]) -> Field:
        """The parameter whose value `field` takes: itself, or the one its default names, and so on."""
        while field.name not in axes and field.name not in given and isinstance(field.default, str):
            field = self.kernel.parameter(field.default)
        return field

    def _along(self, found: Any, outputs: tuple[str, ...]) -> dict[str, NDArray[np.float64]]:
        """Values of every coordinate of the kernel; none of those that no output asked for has."""
        given = self.mistakes.table(found, "along", "[along.phase] with num = 200")
        names = [c.name for c in self.kernel.along]
        for name in given:
            if name not in names and self.kernel is not UNKNOWN:
                hint = did_you_mean(name, names) or (
                    f"; it has {listed(names, word='and')}" if names else "; leave it out"
                )
                self.mistakes.add(f"along.{name}", f"kernel {self.kernel.name} has no such coordinate{hint}")
                self.mistakes.meant.add(nearest(name, names))
        needed = {dim: o.name for o in self.kernel.outputs if o.name in outputs for dim in o.dims}
        along = {}
        for field in self.kernel.along:
            where = f"along.{field.name}"
            along[field.name] = frozen([])
            if field.name in given:
                values = self._coordinate(field, given[field.name], where)
                along[field.name] = values if field.name in needed else frozen([])
            elif field.name in needed and field.name not in self.mistakes.meant and not self.mistakes.unread:
                self.mistakes.add(where, f"missing; output {needed[field.name]} needs it, e.g. num = 200")
        return along

    def _coordinate(self, field: Field, entry: Any, where: str) -> NDArray[np.float64]:
        """Where the study gives nothing but `num`: from one limit to the other, or the first whole numbers."""
        if isinstance(entry, Mapping) and set(entry) == {"num"} and math.isfinite(field.upper - field.lower):
            counted = field.integer and isinstance(entry["num"], int)
            last = min(field.upper, field.lower + entry["num"] - 1) if counted else field.upper
            entry = {"spacing": "linear", "start": field.lower, "stop": last, **entry}
        before = len(self.mistakes)
        values = self.fields.axis(field.name, entry, field, where).values
        inside = (values >= field.lower) & (values <= field.upper) & np.isfinite(values)
        bad = values[~(inside & (values == np.round(values)) if field.integer else inside)]
        if len(bad) and len(self.mistakes) == before:
            kind = "whole numbers" if field.integer else "values"
            self.mistakes.add(where, f"expected {kind} from {field.lower:g} to {field.upper:g}, found {bad[0]:g}")
        return values

    def _check_methods(
        self, method: str, axes: Mapping[str, Axis], fixed: Mapping[str, Any], outputs: tuple[str, ...]
    ) -> None:
        """Methods named that cannot do a term which the study has, or do not give an output asked for."""
        if not self.mistakes.good("fixed"):
            return
        terms = [p.name for p in self.kernel.parameters if p.name in axes or differs(p, fixed)]
        excluded = {m.name: [term for term in m.excludes if term in terms] for m in self.kernel.methods}
        lacking = {m.name: [name for name in m.lacks if name in outputs] for m in self.kernel.methods}
        where, words = _methods_named(method, axes)
        self._refuse(where, words, excluded, "cannot do", "", "leave it out")
        if "auto" in words and excluded and all(excluded.values()):
            hard = [term for term in terms if any(term in found for found in excluded.values())]
            self.mistakes.add(where, f"no method of {self.kernel.name} can do {listed(hard, word='and')} together")
        self._refuse(where, words, lacking, "does not give", ", or name the outputs you want", "name other outputs")

    def _refuse(
        self, where: str, words: Sequence[str], wanting: Mapping[str, Sequence[str]], verb: str, too: str, cure: str
    ) -> None:
        """A mistake for each method named that wants something; the cure: the others (`too`), or where none is left."""
        able = [name for name, found in wanting.items() if not found]
        cure = f"use {listed(['auto', *able])}{too}" if able else cure
        for word in words:
            if wanting.get(word):
                self.mistakes.add(where, f"{word} {verb} {listed(wanting[word], word='and')}; {cure}")


def _kept_first(axes: dict[str, Axis], summary: Summary | None) -> dict[str, Axis]:
    """The axes, those that are reduced behind the others."""
    over = () if summary is None else summary.over
    return dict(sorted(axes.items(), key=lambda item: item[0] in over))


def _methods_named(method: str, axes: Mapping[str, Axis]) -> tuple[str, list[str]]:
    """Where a study names its methods, and which."""
    if "method" in axes:
        return "axes.method", sorted(set(axes["method"].words or ()))
    return "method", [method]
