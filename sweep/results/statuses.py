"""Counts the statuses in a result, with an example of each."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kernels.interface import KINDS, Status
from sweep.cells import partition
from sweep.cells.reduce import BY_METHOD, BY_STATUS
from sweep.cells.schema import METHOD_USED, STATUS
from sweep.errors import SweepError
from sweep.words import counted

if TYPE_CHECKING:
    import xarray as xr

    from sweep.file.reading import Numbers, StoredFile
    from sweep.study.model import Study

    Cells: TypeAlias = xr.Dataset | StoredFile

STATUS_NAMES = {int(status): status.name for status in Status}
NUMBERS_AT_ONCE = 1 << 22


@dataclass(frozen=True)
class Account:
    """What became of all cells.

    Attributes
    ----------
    statuses : dict of str to int
        Cells of every status that occurs, in the order of its number.
    examples : dict of str to dict
        Coordinates of the first cell of each but OK; none of a summary.
    """

    statuses: dict[str, int]
    examples: dict[str, dict[str, str]]

    @property
    def total(self) -> int:
        """All cells."""
        return sum(self.statuses.values())

    @property
    def by_kind(self) -> dict[str, int]:
        """Cells under each of the words of `kernels.interface.KINDS`."""
        counts = dict.fromkeys(KINDS, 0)
        for name, cells in self.statuses.items():
            counts[kind_of(name)] += cells
        return counts

    @property
    def done(self) -> float:
        """Share of the cells that are computed."""
        return 1.0 - self.by_kind["pending"] / max(1, self.total)

    def __str__(self) -> str:
        counts = [f"{cells:,} {kind}" for kind, cells in self.by_kind.items() if cells]
        return f"{counted(self.total, 'cell')}: {', '.join(counts) or 'none'}"


def account(dataset: Cells) -> Account:
    """What became of the cells of a result, of a summary too. Reads a few million of them at a time."""
    if not is_summary(dataset):
        statuses_of(dataset)
    found = _counts(dataset, BY_STATUS, STATUS, STATUS_NAMES)
    shown = () if is_summary(dataset) else (name for name in found if name != Status.OK.name)
    examples = {name: cell_values(dataset, found[name][1]) for name in shown}
    return Account({name: cells for name, (cells, _) in found.items()}, examples)


def kind_of(name: str) -> str:
    """The word under which a status is counted; one that this version does not know counts as FAILED."""
    return (Status[name] if name in Status.__members__ else Status.FAILED).kind


def is_summary(dataset: Cells) -> bool:
    """Whether a result holds reductions, not cells."""
    return BY_STATUS in dataset and STATUS not in dataset


def statuses_of(dataset: Cells) -> Any:
    """What became of each cell. Raises SweepError where the result is a summary, or the Dataset no result."""
    if is_summary(dataset):
        raise SweepError("this is a summary, which keeps no cells; run its study without [summary]")
    if STATUS not in dataset:
        raise SweepError(
            "this Dataset has no variable status, so it is not a result; sweep.run and sweep.open_result return one"
        )
    if dataset[STATUS].dtype.kind not in "iu":
        raise SweepError(
            "status holds fractions or NaN, as after ds.where(...) or a mean; take the result as it was read, or cells "
            "of it by sweep.where(ds, \"status == 'OK'\")"
        )
    return dataset[STATUS]


def require_as_read(dataset: xr.Dataset, study: Study, columns: Iterable[str], whole: bool = False) -> None:
    """Raises SweepError where a parameter or one of the columns is lost, or a unit is not the kernel's; of a `whole`
    result also where its cells are not those of its study in their order."""
    cure = "take cells of the result as it was read"
    for name in (*study.axes, *study.fixed, *columns):
        if name not in dataset:
            raise SweepError(f"{name}: is missing; {cure}")
    for field in (*study.kernel.parameters, *study.kernel.outputs):
        if field.name in dataset and (unit := dataset[field.name].attrs.get("units", field.unit)) != field.unit:
            raise SweepError(f'{field.name}: is in another unit, "{unit}" instead of "{field.unit}"; {cure}')
    if not whole:
        return
    if set(dataset[STATUS].dims) != set(study.dims):
        raise SweepError(f"the cells run along other dimensions than those of their study; {cure}")
    for name, axis in study.axes.items():
        values, own = dataset[name].values, np.array(axis.words or axis.values)
        if not np.array_equal(values, own, equal_nan=own.dtype.kind == "f" == values.dtype.kind):
            raise SweepError(f"{name}: cells are sorted or left out; take the whole result as it was read")


def flag_words(variable: xr.DataArray) -> dict[int, str]:
    """What the codes of a flag variable mean, {} for others; -1 is "none" where the flags do not say."""
    values = np.atleast_1d(variable.attrs.get("flag_values", ())).tolist()
    words = dict(zip(values, str(variable.attrs.get("flag_meanings", "")).split(), strict=False))
    return {-1: "none", **words} if words else {}


def count_methods(dataset: Cells) -> dict[str, int]:
    """How many cells each method solved; those that none did are left out."""
    words = {} if is_summary(dataset) else flag_words(dataset[METHOD_USED])
    counts = _counts(dataset, BY_METHOD, METHOD_USED, words)
    return {name: cells for name, (cells, _) in counts.items() if name != "none"}


def summary_text(dataset: Cells) -> str:
    """After a run: what the cells were solved with, and what became of those that are not OK."""
    found, used = account(dataset), ", ".join(f"{name} {cells:,}" for name, cells in count_methods(dataset).items())
    lines = [f"{found}; solved by {used}" if used else str(found)]
    for name, cells in found.statuses.items():
        if name != Status.OK.name:
            example = cell_text(found.examples.get(name, {}))
            share = f"{cells:,} of {counted(found.total, 'cell')}"
            lines.append(f"{share}: {name}" + (f", e.g. {example}" if example else ""))
    return "\n".join(lines)


def _counts(dataset: Cells, by_word: str, codes: str, words: Mapping[int, str]) -> dict[str, tuple[int, int]]:
    """How many cells have each status or method that occurs, and the number of the first of them; of a summary, 0."""
    if is_summary(dataset):
        counts = dataset[by_word]
        names = dataset[str(counts.dims[-1])].values
        total = counts.values.reshape(-1, len(names)).sum(axis=0)
        return {str(name): (int(n), 0) for name, n in zip(names, total, strict=True) if n}
    found: dict[int, tuple[int, int]] = {}
    done = 0
    for piece in flat_pieces(dataset[codes]):
        # numpy.unique would sort the cells
        for code in np.flatnonzero(np.bincount(piece.astype(np.int16) + 128, minlength=256)) - 128:
            here = piece == code
            cells, first = found.get(int(code), (0, done + int(here.argmax())))
            found[int(code)] = cells + int(here.sum()), first
        done += len(piece)
    return {words.get(code, f"status {code}"): counted for code, counted in sorted(found.items())}


def boxes(shape: Sequence[int], most: int = NUMBERS_AT_ONCE) -> Iterator[tuple[slice, ...]]:
    """Boxes of about so many places, in C order: a run along one dimension, whole ones behind it."""
    if 0 not in shape:
        blocks = partition.boxes(tuple(shape), most)
        yield from (partition.box_slices(tuple(shape), *blocks.bounds(block)) for block in range(blocks.count))


def pieces(dataset: xr.Dataset, dims: Sequence[Hashable], most: int = NUMBERS_AT_ONCE) -> Iterator[xr.Dataset]:
    """Parts of a Dataset along some dimensions, in memory, of at most so many numbers altogether; in C order."""
    sizes = [dataset.sizes[dim] for dim in dims]
    numbers = sum(variable.size for variable in dataset.data_vars.values()) / max(1, math.prod(sizes))
    for box in boxes(sizes, max(1, int(most / max(1.0, numbers)))):
        yield dataset.isel(dict(zip(dims, box, strict=True))).load()


def flat_pieces(column: xr.DataArray | Numbers) -> Iterator[Any]:
    """The cells in C order, a few million at a time."""
    return (np.asarray(column[box]).reshape(-1) for box in boxes(column.shape))


def cell_values(dataset: Cells, index: int) -> dict[str, str]:
    """Coordinates of a cell, as people write them."""
    column = dataset[STATUS]
    at = dict(zip(map(str, column.dims), np.unravel_index(index, column.shape), strict=True))
    cell = {}
    for name, coordinate in dataset.coords.items():
        if coordinate.dims and set(coordinate.dims) <= set(column.dims):
            value = coordinate.values[tuple(at[str(d)] for d in coordinate.dims)]
            cell[str(name)] = f"{value:.6g}" if isinstance(value, np.number) else str(value)
    return cell


def cell_text(cell: Mapping[str, str]) -> str:
    """A cell, in one line."""
    return " ".join(f"{name}={value}" for name, value in cell.items())
