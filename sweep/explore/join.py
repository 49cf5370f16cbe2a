"""Two results of one kernel as one: longer along an axis, or along a new one."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
import xxhash

from kernels.interface import Status
from sweep.cells.fingerprint import difference, fingerprint, is_of_program
from sweep.cells.grid import Grid
from sweep.cells.schema import ANCILLARY, ERROR_BOUND, STATUS, cell_schema
from sweep.errors import SweepError
from sweep.file.open import in_memory, memory
from sweep.results.diff import diff, two_results
from sweep.runs.run import store_cells
from sweep.study.model import SETTINGS, Axis, Block, Study, frozen
from sweep.words import listed

PAIR = ("first", "second")


def join(
    a: xr.Dataset,
    b: xr.Dataset | None = None,
    path: str | os.PathLike[str] | None = None,
    *,
    axis: str | None = None,
    labels: Sequence[str] = PAIR,
    force: bool = False,
) -> xr.Dataset:
    """Two finished results of one kernel as one.

    They may differ in the values of one axis, which becomes longer; in one fixed parameter, method or rtol, which
    becomes an axis; or, told by `axis`, in nothing that a study says, such as the version that computed them. Cells
    that are in both, points of a list or of refined results too, are to be the same bit for bit, and are kept once.

    Parameters
    ----------
    a, b : Dataset
        From `run` or `open_result`.
    path : path, optional
        Where to write it, a result like that of `run`; it can be extended no further. None: in memory.
    axis : str, optional
        Name of a new axis of words.
    labels : two str
        Its values.
    force : bool
        Overwrite another result.

    Raises
    ------
    SweepError
        They are not two results, do not fit together, are unfinished, or do not fit into the memory; or `path` holds
        another result, which a join of other cells or labels is too.

    Examples
    --------
    >>> import sweep
    >>> keys = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": 1.0, "a": 1.0}}
    >>> low, high = (sweep.run(keys | {"axes": {"mu": values}}) for values in ([0.5, 1.0], [2.0, 4.0]))
    >>> sweep.join(low, high).mu.values
    array([0.5, 1. , 2. , 4. ])
    >>> sweep.join(low, low, axis="version", labels=["0.1", "0.2"]).period.dims
    ('version', 'mu')
    """
    a, b = two_results("join", a, b)
    labels = tuple(labels) if np.iterable(labels) else (labels,)
    for dataset in (a, b):
        _require(dataset)
    if 2 * (a.nbytes + b.nbytes) > memory():
        raise SweepError("the two results together do not fit into the memory")
    studies = [Study.from_json(str(dataset.attrs["study_json"]), declared=True) for dataset in (a, b)]
    joined, whole = _joined(studies, (a, b), axis, labels)
    joined = replace(joined, text="", title=studies[0].title)
    arrays = {name: _column(whole, joined, name) for name in (*joined.outputs, *ANCILLARY)}
    versions = _versions((a, b), labels)
    mark = _fingerprint(joined, (a, b), (versions.encode(), *arrays.values()))
    if path is None:
        return in_memory(cell_schema(joined, mark), arrays)
    return store_cells(joined, path, arrays, force, mark, versions)


def _require(dataset: xr.Dataset) -> None:
    if STATUS not in dataset or "study_json" not in dataset.attrs:
        raise SweepError("only results that keep their cells can be joined")
    if bool((dataset[STATUS] == Status.PENDING).any()):
        raise SweepError("an unfinished result cannot be joined; run its sweep to the end first")


def _joined(
    studies: Sequence[Study], results: Sequence[xr.Dataset], axis: str | None, labels: tuple[str, ...]
) -> tuple[Study, xr.Dataset]:
    """The study of both, and the numbers in its dimensions. Raises SweepError."""
    first, second = studies
    apart = _apart(first, second)
    if axis is not None:
        _require_new(first, results[0], axis, labels, apart)
        return _with_axis(first, results, Axis(axis, frozen([0.0, 1.0]), "values", labels))
    if len(apart) != 1:
        what = f"they differ in {listed(apart, word='and')}" if apart else "they do not differ; name a new axis"
        raise SweepError(f"the results do not fit together: {what}")
    group, _, name = apart[0].rpartition(".")
    if group == "axes" and first.design == "product":
        return _longer(first, second, results, name)
    if group == "axes" or apart == ["points"]:
        return _more_points(first, second, results)
    if group == "fixed" or name in SETTINGS:
        return _with_axis(first, results, _new_axis(first, second, name))
    raise SweepError(f"the results do not fit together: they differ in {apart[0]}")


def _apart(a: Study, b: Study) -> list[str]:
    """What two studies differ in, by the names of their fingerprints; axes that run together are one thing."""
    old, new = (_said(study) for study in (a, b))
    names = sorted(name for name in {*old, *new} if old.get(name) != new.get(name))
    if a.dims == b.dims and len(a.dims) == 1 and a.design != "product":
        names = list(dict.fromkeys("points" if name.startswith("axes.") else name for name in names))
    return names


def _said(study: Study) -> dict[str, str]:
    """What a fingerprint has of the study itself."""
    return {name: text for name, text in fingerprint(study).items() if name != "study" and not is_of_program(name)}


def _require_new(study: Study, dataset: xr.Dataset, axis: str, labels: tuple[str, ...], apart: Sequence[str]) -> None:
    if apart:
        raise SweepError(f"along {axis} all else is to be the same; they differ in {listed(apart, word='and')}")
    taken = (*dataset.variables, *SETTINGS, *dataset.dims)
    if not isinstance(axis, str) or not axis.isidentifier() or axis in taken:
        raise SweepError(f'"{axis}" cannot be the name of a new axis; choose another')
    if len(labels) != 2 or len(set(labels)) != 2 or not all(isinstance(label, str) and label for label in labels):
        raise SweepError("a new axis needs two labels that differ")


def _with_axis(study: Study, results: Sequence[xr.Dataset], axis: Axis) -> tuple[Study, xr.Dataset]:
    """The results one above the other, along a new axis."""
    fixed = {name: value for name, value in study.fixed.items() if name != axis.name}
    axes = {axis.name: axis, **study.axes}
    joined = replace(study, axes=axes, fixed=fixed)
    if study.design != "product":
        own = study.blocks or (Block(study.design, tuple(study.axes)),)
        joined = replace(joined, design="blocks", blocks=(Block("product", (axis.name,)), *own))
        results = [dataset.rename(_points(study, joined)) for dataset in results]
    values = axis.words if axis.words is not None else axis.values
    whole = xr.concat([_numbers(dataset, study) for dataset in results], dim=axis.name)
    return joined, whole.assign_coords({axis.name: list(values)})


def _points(old: Study, new: Study) -> dict[str, str]:
    """What dimensions of points are called in a study of blocks."""
    names = {axes: dim for dim, axes in new.dims.items()}
    return {dim: names[axes] for dim, axes in old.dims.items() if dim != names[axes]}


def _new_axis(a: Study, b: Study, name: str) -> Axis:
    """What was one value in each study. Raises SweepError."""
    if name == "method":
        names = [m.name for m in a.kernel.methods]
        codes = [float(names.index(s.method)) if s.method != "auto" else -1.0 for s in (a, b)]
        return Axis(name, frozen(codes), "values", (a.method, b.method))
    if name == "rtol":
        return Axis(name, frozen([a.rtol, b.rtol]), "values")
    values = [study.fixed.get(name) for study in (a, b)]
    if any(value is None or np.ndim(value) for value in values):
        raise SweepError(f"the results do not fit together: they differ in {name}, which is not one number in both")
    words = {float(number): word for word, number in a.kernel.parameter(name).choices.items()}
    said = tuple(words[float(value)] for value in values if isinstance(value, float)) if words else None
    return Axis(name, frozen(values), "values", said)


def _longer(a: Study, b: Study, results: Sequence[xr.Dataset], name: str) -> tuple[Study, xr.Dataset]:
    """Both, longer along an axis that both have; what is in both has to be the same."""
    if set(results[0][name].values.tolist()) & set(results[1][name].values.tolist()):
        _require_same(*results)
    one, other = a.axes[name], b.axes[name]
    fresh = [k for k, label in enumerate(_keys(other)) if label not in set(_keys(one))]
    parts = [_numbers(results[0], a), _numbers(results[1], b).isel({name: fresh})]
    whole = xr.concat(parts, dim=name)
    axis = _appended(one, other, fresh)
    order = np.arange(len(axis)) if axis.words else np.argsort(axis.values, kind="stable")
    axis = replace(axis, values=frozen(axis.values[order]))
    return replace(a, axes={**a.axes, name: axis}), whole.isel({name: order})


def _require_same(first: xr.Dataset, second: xr.Dataset) -> None:
    """Raises SweepError where a cell that both have is not the same in both."""
    found = diff(first, second)
    if found.statuses or any(distance.cells for distance in found.outputs.values()):
        raise SweepError(f"the results do not fit together: cells that are in both differ\n{found}")


def _keys(axis: Axis) -> list[Any]:
    values = axis.words if axis.words is not None else axis.values.tolist()
    return [tuple(value) if isinstance(value, list) else value for value in values]


def _more_points(a: Study, b: Study, results: Sequence[xr.Dataset]) -> tuple[Study, xr.Dataset]:
    """The points of one behind those of the other; what is in both has to be the same."""
    dim = next(iter(a.dims))
    first, second = results
    places = {point: place for place, point in enumerate(_cells(a))}
    here = [places.get(point) for point in _cells(b)]
    shared = [place for place, there in enumerate(here) if there is not None]
    if shared:
        _require_same(first.isel({dim: [here[place] for place in shared]}), second.isel({dim: shared}))
    fresh = [place for place, there in enumerate(here) if there is None]
    whole = xr.concat([_numbers(first, a), _numbers(second, b).isel({dim: fresh})], dim=dim)
    axes = {name: _appended(axis, b.axes[name], fresh) for name, axis in a.axes.items()}
    return replace(a, design="zip", blocks=(), axes=axes), whole


def _cells(study: Study) -> Iterable[tuple[Any, ...]]:
    """The values of each point of a list."""
    return zip(*(_keys(axis) for axis in study.axes.values()), strict=True)


def _appended(a: Axis, b: Axis, places: Sequence[int]) -> Axis:
    """An axis, and behind it the values at some places of another."""
    words = None if a.words is None or b.words is None else (*a.words, *(b.words[k] for k in places))
    return Axis(a.name, frozen(np.concatenate([a.values, b.values[places]])), "values", words)


def _numbers(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """Outputs and what is said of them, without coordinates."""
    found = dataset if ERROR_BOUND in dataset else dataset.assign({ERROR_BOUND: dataset[STATUS] * np.float32(np.nan)})
    return found[[*study.outputs, *ANCILLARY]].drop_vars(list(dataset.coords)).compute()


def _column(whole: xr.Dataset, study: Study, name: str) -> Any:
    """A column of all cells, in the order of the study's grid."""
    grid = Grid(study)
    inner = [d for d in whole[name].dims if d not in grid.dims]
    values = whole[name].transpose(*grid.dims, *inner).values
    return np.ascontiguousarray(values.reshape(grid.size, *values.shape[len(grid.dims) :]))


def _fingerprint(joined: Study, results: Sequence[xr.Dataset], content: Iterable[Any]) -> dict[str, str]:
    """That of the study, with the program that both were computed by, and a digest of all cells and labels."""
    state = xxhash.xxh3_128()
    for piece in content:
        state.update(piece)
    old, new = (json.loads(str(dataset.attrs["fingerprint"])) for dataset in results)
    program = {name: text for name, text in old.items() if is_of_program(name) and new.get(name) == text}
    apart = "; ".join(line for line in difference(old, new) if is_of_program(line.partition(":")[0]))
    return {
        "study": fingerprint(joined)["study"],
        **_said(joined),
        **program,
        "joined": f"of two results (digest {state.hexdigest()}). {apart}".strip(),
    }


def _versions(results: Sequence[xr.Dataset], labels: Sequence[str]) -> str:
    """Which program computed what, a line each."""
    return "\n".join(f"{label}: {d.attrs.get('versions', '')}" for label, d in zip(labels, results, strict=True))
