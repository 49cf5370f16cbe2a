"""What `sweep fit` prints: power laws along one axis, one line for each combination of the other axes."""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.cells.schema import ANCILLARY, STATUS
from sweep.errors import SweepError
from sweep.file import disk
from sweep.show.view import preferred
from sweep.words import cell, columns, did_you_mean, listed, page

if TYPE_CHECKING:
    import xarray as xr

MOST_ROWS = 40

WORST_MISFIT = 0.1
"""Relative distance of a point beyond which a report does not speak of two laws."""

EXPLANATION = (
    "The interval is of {confidence:g} % confidence where the values scatter, and never less than for scatter that "
    "remembers the point before; where they do not, it is what the stated errors can do. Where p runs from one value "
    "to another, one power law does not fit, and these are the ends of the local exponent in the window. A second law "
    "is told where AICc and BIC prefer it by more than 10; --compare tries other laws. Drift is how far the exponent "
    "changes across the window; residual is the largest relative distance of a point from the curve."
)


def pick(dataset: xr.Dataset, choices: Sequence[str]) -> xr.Dataset:
    """The part of a result where axes have the given values.

    Parameters
    ----------
    choices : sequence of str
        "axis=value" each.

    Raises
    ------
    SweepError
        There is no such axis, or it has no such value.
    """
    for choice in choices:
        name, equals, value = choice.partition("=")
        if not equals:
            raise SweepError(f'--at {choice}: expected axis=value, e.g. "mu=0.1"')
        axes = [str(n) for n, c in dataset.coords.items() if c.ndim == 1]
        if name not in axes:
            hint = did_you_mean(name, axes) or f"; there are {listed(axes, word='and')}"
            raise SweepError(f"--at {choice}: no axis {name}{hint}")
        coordinate = dataset[name]
        found = _positions(coordinate, value, choice)
        dim = str(coordinate.dims[0])
        dataset = dataset.isel({dim: found[0] if dim == name else found})
    return dataset


@dataclass(frozen=True)
class Laws:
    """Power laws y ~ x^p over each window; for one window also two laws with a bend, for two where they meet."""

    y: str
    x: str
    fits: tuple[xr.Dataset, ...]
    bend: xr.Dataset | None
    meeting: xr.Dataset | None
    confidence: float
    remark: str = ""
    """What became of cells that are not OK."""


def laws(
    dataset: xr.Dataset,
    y: str | None,
    x: str,
    windows: Sequence[Sequence[float]] = (),
    confidence: float = 0.95,
    noise: bool | str | None = None,
) -> Laws:
    """What `sweep fit` finds; `y` and `noise` as of `output_of` and `fit_exponent`. Raises SweepError."""
    from sweep.laws.curves import stated_error
    from sweep.laws.lines import crossover, fit_exponent

    y = output_of(dataset, y)
    if len(windows) > 2:
        raise SweepError(f"--window: expected one or two, found {len(windows)}")
    limits: list[tuple[float, float] | None] = [*sorted((low, high) for low, high in windows)] or [None]
    keys: dict[str, Any] = {"confidence": confidence, "noise": noise, "bound": stated_error(dataset, y)}
    fits = tuple(fit_exponent(dataset[y], x, window, **keys) for window in limits)
    remark = " ".join(filter(None, (dataset.attrs.get("lines", ""), _remark(dataset, y))))
    if len(fits) == 2:
        return Laws(y, x, fits, None, crossover(fits[0], fits[1]), confidence, remark)
    return Laws(y, x, fits, _bend(dataset[y], x, limits[0], confidence, noise), None, confidence, remark)


def output_of(dataset: xr.Dataset, y: str | None) -> str:
    """The output `y`, by default the one that is drawn. Raises SweepError where there is no such output."""
    outputs = [str(name) for name in dataset.data_vars if name not in ANCILLARY]
    if y is None:
        return preferred(outputs)
    if y not in outputs:
        hint = did_you_mean(y, outputs) or f"; there are {listed(outputs, word='and')}"
        raise SweepError(f"--y {y}: no such output{hint}")
    return y


def _remark(dataset: xr.Dataset, y: str) -> str:
    """Cells that are not OK, by status; those with a value are in the fit."""
    from sweep.results.statuses import flag_words

    if STATUS not in dataset or dataset[y].dims != dataset[STATUS].dims:
        return ""
    status, valued, words = dataset[STATUS].values, dataset[y].notnull().values, flag_words(dataset[STATUS])
    parts = []
    for code in np.unique(status[status != 0]).tolist():
        here = status == code
        counts = {"in the fit": int((here & valued).sum()), "left out": int((here & ~valued).sum())}
        parts += [f"{count} {words.get(code, code)} ({fate})" for fate, count in counts.items() if count]
    return f"Of {status.size} cells: {', '.join(parts)}." if parts else ""


def _bend(
    y: xr.DataArray, x: str, window: tuple[float, float] | None, confidence: float, noise: bool | str | None
) -> xr.Dataset | None:
    """Two laws, where any line has points enough for them and is not straight."""
    from sweep.laws.two_laws import FEWEST_POINTS, fit_two_laws

    if y.sizes[str(y[x].dims[0])] < FEWEST_POINTS:
        return None
    try:
        found = fit_two_laws(y, x, window, confidence=confidence, noise=noise)
    except SweepError:  # the window leaves too few points
        return None
    return found if bool((found.regimes == 2).any()) else None


def laws_text(found: Laws) -> str:
    """The laws as people read them."""
    texts = [_table(f"{found.y} ~ {found.x}^p", _heading(found.fits[0]), found.fits, _fit_cells)]
    if found.bend is not None:
        heading = (*_dims(found.bend, "law"), "p low", "interval", "p high", "interval", found.x, "interval", "bend")
        texts.append(_table("two laws with a smooth bend", heading, [found.bend], _bend_cells))
    if found.meeting is not None:
        heading = (*_dims(found.meeting), found.x, "", found.y)
        texts.append(_table("the two laws meet", heading, [found.meeting], _meeting_cells))
    notes = [text for text in (found.remark, explanation(found.confidence)) if text]
    return page(*texts, *(columns([(text,)], indent="") for text in notes))


def law_rows(found: Laws) -> Iterator[tuple[str, ...]]:
    """Output, where, exponent, interval and largest distance: a line for one law, two lines for two with a bend."""
    bend = found.bend
    for labels, fit in _points(found.fits[0]):
        where = ", ".join(f"{dim} = {label}" for dim, label in zip(_dims(found.fits[0]), labels, strict=True))
        name = f"{found.y} ({where})" if where else found.y
        both = None if bend is None else bend.sel({d: fit[d] for d in _dims(bend, "law") if d in fit.coords})
        if both is None or both.exponent.ndim != 1 or both.regimes.item() != 2 or both.residual.item() > WORST_MISFIT:
            window, exponent, interval, _, _, residual, _ = _fit_cells(fit)
            yield name, f"{found.x} {window}", exponent, interval, residual
            continue
        for law, sign in (("low", "<<"), ("high", ">>")):
            one = both.sel(law=law)
            interval = _interval(one.exponent_low.item(), one.exponent_high.item())
            place, off = f"{found.x} {sign} {one.crossover.item():.3g}", f"{one.residual.item():.1e}"
            yield name, place, f"{one.exponent.item():.6g}", interval, off


def explanation(confidence: float) -> str:
    """What intervals, drift and residual mean."""
    return EXPLANATION.format(confidence=100 * confidence)


def write_laws(found: Laws, path: Path) -> None:
    """The laws as csv: a row for each line and window; of two laws a row each. Raises SweepError."""
    rows = [row for fit in found.fits for row in _table_rows(fit, "one")]
    if found.bend is not None:
        rows += [row for law in ("low", "high") for row in _table_rows(found.bend.sel(law=law), law)]
    if found.meeting is not None:
        rows += list(_table_rows(found.meeting, "meeting"))
    rows = [{cell(name): cell(value) for name, value in row.items()} for row in rows]
    names = list(dict.fromkeys(name for row in rows for name in row))
    with disk.replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _table_rows(fit: xr.Dataset, law: str) -> Iterator[dict[str, Any]]:
    for labels, point in _points(fit):
        start = {"y": fit.attrs["y"], "x": fit.attrs["x"], "law": law, **dict(zip(_dims(fit), labels, strict=True))}
        yield start | {str(name): variable.item() for name, variable in point.data_vars.items()}


def _positions(coordinate: xr.DataArray, value: str, choice: str) -> Any:
    """Positions along an axis that have the value, up to rounding in its sixth digit."""
    values = coordinate.values
    if values.dtype.kind not in "fiu":
        found = np.flatnonzero(values.astype(str) == value)
        shown = listed(dict.fromkeys(map(str, values)), quote=True)
    else:
        try:
            wanted = float(value)
        except ValueError:
            raise SweepError(f"--at {choice}: expected a number after =") from None
        # six digits are what `sweep show` and `sweep run` print
        found = np.flatnonzero(np.isclose(values, wanted, rtol=1e-5, atol=0, equal_nan=True))
        found = found[np.argsort(np.abs(values[found] - wanted), kind="stable")]
        nearest = values[np.argsort(np.abs(values - wanted))[:2]]
        shown = listed(f"{v:.6g}" for v in nearest)
    if not len(found):
        raise SweepError(f"--at {choice}: {coordinate.name} has no such value; nearest is {shown}")
    return found


def _dims(dataset: xr.Dataset, *without: str) -> list[str]:
    return [str(dim) for dim in dataset.sizes if dim not in without]


def _heading(fit: xr.Dataset) -> tuple[str, ...]:
    at_one = f"{fit.attrs['y']} at {fit.attrs['x']} = 1"
    return (*_dims(fit), "window", "p", "interval", "points", "drift", "residual", at_one)


def _table(title: str, heading: Sequence[str], datasets: Sequence[xr.Dataset], cells: Any) -> str:
    """A line for each point of each Dataset, at most `MOST_ROWS` of them."""
    points = [point for dataset in datasets for point in _points(dataset, "law")]
    rows = [(*labels, *cells(point)) for labels, point in points[:MOST_ROWS]]
    more = f"\n  and {len(points) - MOST_ROWS} more; choose with --at axis=value" * (len(points) > MOST_ROWS)
    return f"{title}\n{columns([heading, *rows])}{more}"


def _points(dataset: xr.Dataset, *without: str) -> Iterator[tuple[list[str], xr.Dataset]]:
    dims = _dims(dataset, *without)
    for position in itertools.product(*(range(dataset.sizes[dim]) for dim in dims)):
        places = dict(zip(dims, position, strict=True))
        point = dataset.isel(places)
        yield [_label(point, dim, i) for dim, i in places.items()], point


def _label(point: xr.Dataset, dim: str, place: int) -> str:
    """A value of an axis; of a dimension that has none its number."""
    value = point[dim].item() if dim in point.coords else str(place)
    return value if isinstance(value, str) else f"{value:.6g}"


def _fit_cells(fit: xr.Dataset) -> tuple[str, ...]:
    v = {str(name): variable.item() for name, variable in fit.data_vars.items()}
    return (
        f"{v['low']:.4g} to {v['high']:.4g}",
        f"{v['exponent']:.{8 if v['fits'] == 1 else _digits(**v)}g}",
        ("" if v["fits"] == 1 else "runs from ") + _interval(v["exponent_low"], v["exponent_high"]),
        f"{v['points']}",
        f"{v['drift']:.1e}",
        f"{v['residual']:.1e}",
        f"{v['prefactor']:.6g}",
    )


def _digits(exponent: float, exponent_low: float, exponent_high: float, **_: float) -> int:
    """Of an exponent that does not fit: as many as the range of the local one has in common, two or three."""
    return 3 if abs(exponent_high - exponent_low) < 0.1 * abs(exponent) else 2


def _interval(low: float, high: float) -> str:
    """Both ends, with as many digits as tell them apart, and two more."""
    apart = abs(high - low)
    digits = (
        8 if not math.isfinite(apart) or apart == 0 else 2 - math.floor(math.log10(apart / max(abs(low), abs(high))))
    )
    digits = max(3, min(digits, 15))
    return f"{low:.{digits}g} to {high:.{digits}g}"


def _bend_cells(bend: xr.Dataset) -> tuple[str, ...]:
    if bend.regimes.item() != 2:
        return *("-",) * 6, "one law does as well"
    cells = []
    for law in ("low", "high"):
        one = bend.sel(law=law)
        cells += [f"{one.exponent.item():.6g}", _interval(one.exponent_low.item(), one.exponent_high.item())]
    place = _interval(bend.crossover_low.item(), bend.crossover_high.item())
    width = f"{bend.width.item():.2g} decades wide, residual {bend.residual.item():.1e}"
    return *cells, f"{bend.crossover.item():.6g}", place, width


def _meeting_cells(meeting: xr.Dataset) -> tuple[str, ...]:
    v = {str(name): variable.item() for name, variable in meeting.data_vars.items()}
    return f"{v['abscissa']:.6g}", f"+- {v['abscissa_error']:.1e}", f"{v['ordinate']:.6g}"
