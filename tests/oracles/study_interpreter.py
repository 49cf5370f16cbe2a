"""What a study means, one cell after the other: the slow and plain way to what the engine gives.

Reads the keys of a study, `docs/study.md`, and a kernel, `kernels/interface.py`; it imports nothing of `sweep`.
"""

from fractions import Fraction
from itertools import product
from math import inf, isnan, nan

import numpy as np
from columns import bounds, called, checked, columns_of, unwritten

from kernels.interface import Status

GIVES_UP = {"NO_METHOD", "NO_CYCLE", "NOT_CONVERGED", "STEP_LIMIT", "INACCURATE", "UNSTABLE", "FAILED"}
DOUBTED = Status.INACCURATE, Status.GRAZING


def interpreted(kernel, keys):
    """Every column of the result, as {name: (dims, values)}; of a summary, its reductions."""
    blocks, dims = keys.get("blocks", [keys]), {}
    for block in blocks:
        word, number = "cell" if len(blocks) == 1 else "point", sum("point" in d for d in dims)
        together = {f"{word}_{number + 1}" if number else word: list(block["axes"])}
        dims |= {n: [n] for n in block["axes"]} if block.get("design", "product") == "product" else together
    axes = {name: values for block in blocks for name, values in block["axes"].items()}
    summary = keys.get("summary", {"over": []})
    over = summary.get("over", axes)
    dims = dict(sorted(dims.items(), key=lambda item: item[1][0] in over))
    shape = [len(axes[names[0]]) for names in dims.values()]
    places = product(*map(range, shape))
    here = [{n: axes[n][k] for k, names in zip(p, dims.values(), strict=True) for n in names} for p in places]
    cells = [Cell(kernel, keys, values).found() for values in here]
    fields = [f for f in kernel.outputs if f.name in keys["outputs"]]
    kinds = {f.name: (f.dims, "f8") for f in fields} | {"status": ((), "i1"), "method_used": ((), "i1")}
    kinds |= {"error_bound": ((), "f8")}
    columns = {name: (own, np.array([c[name] for c in cells], kind)) for name, (own, kind) in kinds.items()}
    if "summary" in keys:
        dims = [d for d, names in dims.items() if names[0] not in over]
        shape = shape[: len(dims)]
        columns = summed_up(kernel, fields, summary, columns, here, int(np.prod(shape, dtype=int)))
    return {name: ((*dims, *own), v.reshape((*shape, *v.shape[1:]))) for name, (own, v) in columns.items()}


class Cell:
    """The cell of a study whose axes have some values."""

    def __init__(self, kernel, keys, here):
        given, self.kernel, self.keys = keys.get("fixed", {}) | here, kernel, keys | here
        fields = {f.name: f.choices for f in kernel.parameters if f.name in given}
        numbers = {name: [words[given[name]] if words else given[name]] for name, words in fields.items()}
        self.columns = columns_of(kernel, (), numbers)
        self.p = {f.name: column for f, column in zip(kernel.parameters, self.columns, strict=True)}
        words = {f.name: {number: word for word, number in f.choices.items()} for f in kernel.parameters}
        self.words = {n: words[n][c[0]] if words[n] else c[0] for n, c in self.p.items()}
        self.rtol = np.array([self.keys.get("rtol", 1e-9)], float)
        self.along = [np.array(keys.get("along", {}).get(f.name, ()), float) for f in kernel.along]

    def found(self):
        """Outputs, status, method and error bound, by name."""
        numbers, method = {m.name: k for k, m in enumerate(self.kernel.methods)}, self.keys.get("method")
        with np.errstate(all="ignore"):
            number, status, error, outputs = -1, Status.NOT_ASKED, nan, None
            if eval(self.keys.get("where", "True"), {}, self.words):
                try:
                    status = allowed(checked(self.kernel, *self.columns)[0])
                    if status < 64:
                        number, status, error, outputs = self.ran(numbers[method]) if method in numbers else self.auto()
                except ZeroDivisionError:  # what our kernels raise
                    status = Status.FAILED
        if status >= 64:  # a refusal
            number, error, outputs = -1, nan, unwritten(self.kernel, self.columns, self.along)
        columns = {name: values[0] for name, values in outputs.items()}
        return columns | {"status": status, "method_used": number, "error_bound": error}

    def bound(self, method):
        """What a method promises: rtol where it holds that by itself, inf where nothing is known."""
        if method.bound is None:
            return self.rtol[0]
        words = {"asked": self.keys["outputs"], "rtol": self.rtol, "along": self.along}
        (bound,) = bounds(self.kernel, method.name, *self.columns, **words)
        return inf if isnan(bound) else bound

    def ran(self, number):
        """The same by one method: INACCURATE where it is known to be worse than rtol, FAILED where OK has no number."""
        method, asked = self.kernel.methods[number], self.keys["outputs"]
        outputs, (status,), (told,) = called(self.kernel, method.name, self.columns, self.rtol, self.along, asked)
        whole = all(np.isfinite(outputs[f.name]).all() for f in self.kernel.outputs if f.name in asked and not f.gaps)
        status = Status.FAILED if status == Status.OK and not whole else allowed(status)
        error = told if method.estimates else inf if status == Status.INACCURATE else 0.0
        bound = 0.0 if method.estimates and not method.bound else self.bound(method)
        error = inf if isnan(error) else max(error, bound)
        kept = status >= 64 or status == Status.GRAZING or error <= self.rtol
        return number, status if kept else Status.INACCURATE, error, outputs

    def auto(self):
        """The first method that can do the cell, promises rtol and does not give up; else the best of what there is."""
        default = {f.name: self.p.get(f.default, f.default) for f in self.kernel.parameters}
        turns, best = [], (-1, Status.NO_METHOD, inf, None)
        for number, method in enumerate(self.kernel.methods):
            unable = any((self.p[n] != default[n]).any() for n in method.excludes)
            if not unable and not set(method.lacks) & set(self.keys["outputs"]):
                early = method.sooner is not None and method.sooner(*self.columns, self.rtol)[0]
                turns.append((max(self.bound(method), self.rtol[0]), number - 1.5 if early else number, number))
        for bound, _, number in sorted(turns):
            least = inf if best[1] >= 64 else best[2] if best[1] in DOUBTED else 0.0
            if bound <= self.rtol or bound < least:
                best = better(best, self.ran(number))
            grazes = best[1] == Status.GRAZING and best[2] > self.rtol
            unsure = best[1] == Status.OUT_OF_RANGE and self.kernel.methods[number].estimates
            if bound <= self.rtol and not (grazes or unsure or best[1].name in GIVES_UP):
                return best
        return best


def allowed(status):
    """What a kernel may say; else FAILED."""
    return Status(status) if 0 <= status < Status.NOT_ASKED else Status.FAILED


def better(old, new):
    """Which of two is handed out: values before refusals, the smaller error, the refusal that tells more, the later."""
    tried, (_, was, error, _), (_, is_, less, _) = old[0] >= 0, old, new
    if was < 64:
        looser = is_ == Status.UNSTABLE or (is_ in DOUBTED and not less < error)
        return old if is_ >= 64 or (was in DOUBTED and looser) else new
    vague, unsolved = (Status.NO_METHOD, Status.NO_CYCLE), (Status.NO_METHOD, Status.NOT_CONVERGED, Status.STEP_LIMIT)
    if (tried and is_ == Status.NO_CYCLE and was in unsolved) or (was == Status.OUT_OF_RANGE and is_ in unsolved):
        return old
    return old if is_ in vague and was not in vague else new


def summed_up(kernel, fields, summary, columns, here, count):
    """The reductions that a summary asks for, of so many groups of cells."""
    groups, found = np.arange(len(here)).reshape(count, -1), {}
    for f in fields:
        own, values = columns[f.name]
        for name in ("count", *summary["outputs"][f.name]):
            all_of = [(g, values[(g, *i)]) for g in groups for i in np.ndindex(values.shape[1:])]
            parts = [reduced(name, g[~np.isnan(v)], v[~np.isnan(v)], here, columns, summary, f) for g, v in all_of]
            for part in parts[0]:
                column, bins = np.array([p[part] for p in parts]), [f"{f.name}_bin"] * (part == "histogram")
                found[f"{f.name}_{part}"] = (*own, *bins), column.reshape((count, *values.shape[1:], *column.shape[1:]))
    for name, kinds in (("status", [*Status, 128]), ("method_used", range(-1, len(kernel.methods)))):
        counts = np.array([[(columns[name][1][g] == kind).sum() for kind in kinds] for g in groups])
        found[f"cells_by_{name.partition('_')[0]}"] = (f"{name.partition('_')[0]}_name",), counts
    return found


def reduced(name, cells, numbers, here, columns, summary, field):
    """One reduction of numbers, each of its cell."""
    if name == "histogram":
        edges = summary["edges"][field.name]
        below, above = (numbers < edges[0]).sum(), (numbers > edges[-1]).sum()
        return {"below": below, name: np.histogram(numbers, edges)[0], "above": above}
    if name in ("argmin", "argmax"):
        best = cells[getattr(np, name)(numbers)] if len(cells) else None
        found = {f"{name}_status": -1 if best is None else columns["status"][1][best]}
        for axis in summary["over"]:
            none = "none" if isinstance(here[0][axis], str) else nan
            found[f"{name}_{axis}"] = none if best is None else here[best][axis]
        return found
    if name == "mean" and len(cells):
        exact = np.isfinite(numbers).all()
        numbers = [(float(sum(map(Fraction, numbers.tolist()))) if exact else sum(numbers.tolist())) / len(cells)]
    return {name: len(cells) if name == "count" else (max if name == "max" else min)(numbers, default=nan)}
