"""Joins two results of one kernel along an axis, or along a new one."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from kernels.interface import Status
from sweep.cells.fingerprint import is_own_source, said
from sweep.cells.grid import Grid
from sweep.cells.schema import ANCILLARY
from sweep.errors import SweepError
from sweep.file.disk import check_target
from sweep.file.open import memory, store_cells
from sweep.results.diff import diff
from sweep.results.statuses import require_as_read, statuses_of
from sweep.study.model import SETTINGS, Axis, Block, Study, frozen, setting
from sweep.words import as_path, listed, require_dataset

PAIR = ("first", "second")


def join(
    a: xr.Dataset,
    b: xr.Dataset,
    path: str | os.PathLike[str] | None = None,
    *,
    axis: str | None = None,
    labels: Sequence[str] = PAIR,
    force: bool = False,
) -> xr.Dataset:
    """Join two finished results of one kernel.

    They may differ in the values of one axis, which are merged, or in one fixed parameter, method or rtol, which
    becomes an axis. If their studies are equal, for example when two versions computed them, `axis` and `labels` make a
    new axis. Cells in both results must be identical to the last bit. Without a new axis, the source of a kernel of
    your own must not have changed in between.

    Parameters
    ----------
    a, b : Dataset
        From `run` or `open_result`.
    path : path, optional
        File to write, like that of `run`, except that it cannot be extended. None: in memory.
    axis : str, optional
        Name of a new axis of words.
    labels : two str
        Its values.
    force : bool
        Overwrite an existing file.

    Raises
    ------
    SweepError
        A Dataset is not a finished result, the results do not fit together or exceed the memory, or there is a file, or
        an unfinished result of another study, at `path`.

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
    results, labels = (a, b), tuple(labels) if np.iterable(labels) else (labels,)
    for dataset in results:
        require_dataset("join", dataset)
        if bool((statuses_of(dataset) == Status.PENDING).any()):
            raise SweepError("an unfinished result cannot be joined; run its sweep to the end first")
    if 2 * sum(dataset.nbytes for dataset in results) > memory():
        raise SweepError("the two results together do not fit into the memory")
    studies = [Study.of(dataset, declared=True) for dataset in results]
    known = [json.loads(dataset.attrs.get("fingerprint", "{}")) for dataset in results]
    own, other = ({name: one[name] for name in one if is_own_source(name)} for one in known)
    if axis is None and (changed := [name for name in own if own[name] != other.get(name, own[name])]):
        raise SweepError(
            f"the kernel's own {listed(changed, word='and')} changed between the two; compute one of them again, or "
            'join them along a new axis (axis="version")'
        )
    for dataset, study in zip(results, studies, strict=True):
        require_as_read(dataset, study, [*study.outputs, *ANCILLARY], whole=True)
    # what they differ in: "axes.mu", "fixed.a", "rtol"; of axes that run together "points"
    old, new = map(said, studies)
    apart = sorted(name for name in {*old, *new} if old.get(name) != new.get(name))
    if studies[0].dims == studies[1].dims and len(studies[0].dims) == 1 and studies[0].design != "product":
        apart = list(dict.fromkeys("points" if name.startswith("axes.") else name for name in apart))
    longer = apart[0].removeprefix("axes.") if axis is None and len(apart) == 1 else ""
    if longer == "points" or longer in studies[0].dims:
        study, whole = _longer(studies[0], studies[1], results, longer)
    else:
        study, whole = _with_axis(studies[0], results, _new_axis(apart, studies, axis, labels, results[0]))
    study = replace(study, text="", title=studies[0].title)

    grid, arrays = Grid(study), dict[str, Any]()
    for name in (*study.outputs, *ANCILLARY):
        values = whole[name].transpose(*study.grid_shape, ...).values
        arrays[name] = np.ascontiguousarray(values.reshape(grid.size, *values.shape[len(grid.shape) :]))
    if path is not None:
        sources = [Path(d.encoding["source"]) for d in results if "source" in d.encoding]
        check_target(as_path(path), force=force, read=sources)
    versions = "\n".join(f"{k}: {d.attrs.get('versions', '')}" for k, d in zip(labels, results, strict=False))
    # no run continues it, nor is it of the program that joins
    mark = {**said(study), **(own if axis is None else {}), "joined": "of two results"}
    return store_cells(study, path, arrays, force, mark, {"taken_over": versions})


def _new_axis(
    apart: Sequence[str], studies: Sequence[Study], axis: Any, labels: tuple[Any, ...], dataset: xr.Dataset
) -> Axis:
    """What two results stand along: two labels, or the one parameter or setting that they differ in. SweepError."""
    if axis is not None:
        if apart:
            fault = f"along {axis} all else is to be the same; they differ in {listed(apart, word='and')}"
            cure = f"; without a new axis they are joined along {axis}" * apart[0].endswith(f".{axis}")
            raise SweepError(fault + cure)
        taken = (*dataset.variables, *SETTINGS, *dataset.dims)
        if not isinstance(axis, str) or not axis.isidentifier() or axis in taken:
            raise SweepError(f'"{axis}" cannot be the name of a new axis; choose another')
        if len(labels) != 2 or len(set(labels)) != 2 or not all(isinstance(label, str) and label for label in labels):
            raise SweepError("a new axis needs two labels that differ")
        return Axis(axis, frozen([0.0, 1.0]), "values", labels)
    kernel, name = studies[0].kernel, apart[0].removeprefix("fixed.") if len(apart) == 1 else ""
    if name not in SETTINGS and apart != [f"fixed.{name}"]:
        differ = f"they differ in {listed(apart, word='and')}" if apart else "they do not differ; name a new axis"
        raise SweepError(f"the results do not fit together: {differ}")
    field = setting(name, kernel) if name in SETTINGS else kernel.parameter(name)
    values: list[Any] = [getattr(study, name) if name in SETTINGS else study.fixed.get(name) for study in studies]
    if any(value is None or np.ndim(value) for value in values):
        raise SweepError(f"the results do not fit together: they differ in {name}, which is not one number in both")
    numbers = [float(field.choices.get(value, value)) for value in values]
    words = {float(number): word for word, number in field.choices.items()}
    return Axis(name, frozen(numbers), "values", tuple(words[number] for number in numbers) if words else None)


def _with_axis(study: Study, results: Sequence[xr.Dataset], axis: Axis) -> tuple[Study, xr.Dataset]:
    """The results one above the other, along a new axis."""
    fixed = {name: value for name, value in study.fixed.items() if name != axis.name}
    joined = replace(study, axes={axis.name: axis, **study.axes}, fixed=fixed)
    if study.design != "product":
        own = study.blocks or (Block(study.design, tuple(study.axes)),)
        joined = replace(joined, design="blocks", blocks=(Block("product", (axis.name,)), *own))
        # dimensions of points have other names in a study of blocks
        names = {axes: dim for dim, axes in joined.dims.items()}
        results = [dataset.rename({dim: names[axes] for dim, axes in study.dims.items()}) for dataset in results]
    return joined, xr.concat([_numbers(dataset, study) for dataset in results], dim=axis.name)


def _longer(a: Study, b: Study, results: Sequence[xr.Dataset], name: str) -> tuple[Study, xr.Dataset]:
    """Both, longer along an axis or by further points; what is in both has to be the same."""
    product = name in a.dims
    names, dim = ([name], name) if product else (list(a.axes), next(iter(a.dims)))
    values = {name: np.concatenate([a.axes[name].values, b.axes[name].values]) for name in names}
    points = np.column_stack([column.reshape(len(column), -1) for column in values.values()])
    _, first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)
    if not product:  # cells are told apart by their points
        numbers = np.split(number.ravel(), [len(a.axes[names[0]])])
        results = [dataset.assign_coords({dim: here}) for dataset, here in zip(results, numbers, strict=True)]
    one, other = results
    found = diff(one, other)
    if found.statuses or any(distance.cells for distance in found.outputs.values()):
        raise SweepError(f"the results do not fit together: cells that are in both differ\n{found}")
    # numbers of an axis of a product rise; words and points stand as they are given
    kept = np.sort(first) if a.axes[names[0]].words or not product else first
    whole = xr.concat([_numbers(dataset, a) for dataset in results], dim=dim).isel({dim: kept})
    axes = dict(a.axes)
    for name, column in values.items():
        old, new = a.axes[name].words, b.axes[name].words
        words = tuple((*old, *new)[k] for k in kept) if old and new else None
        axes[name] = Axis(name, frozen(column[kept]), "values", words)
    return replace(a, axes=axes) if product else replace(a, design="zip", blocks=(), axes=axes), whole


def _numbers(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """Outputs and what is said of them, without coordinates."""
    return dataset[[*study.outputs, *ANCILLARY]].drop_vars(list(dataset.coords), errors="ignore").compute()
