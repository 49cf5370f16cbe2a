"""Output of `sweep fit`: power laws along one axis, one row per line; with `--compare` all laws of one line."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.cells.schema import ANCILLARY, STATUS
from sweep.errors import SweepError
from sweep.file import disk
from sweep.results.statuses import flag_words
from sweep.show.view import one_of, preferred
from sweep.units import UnitMistake, measured
from sweep.words import Table, cell, counted, listed, page, paragraph

if TYPE_CHECKING:
    import xarray as xr

MOST_ROWS = 40
POINTS = 12
"""Local exponents of a line that are printed."""
REST = "Points, drift, residual, prefactor, and what the columns mean: --all; other laws: --compare."
EXPLANATION = (
    "If the values scatter, the interval contains the exponent with {confidence:g} % confidence, and is never "
    "narrower than for autocorrelated scatter; if they do not, it is what their stated error bounds allow. Where it "
    "is marked bent, one power law does not fit, and it is the range of the local exponent in the window. A second law "
    "is reported if AICc and BIC prefer it by more than 10. Drift is the change of the exponent "
    "across the window; residual is the largest relative distance of a point from the law."
)
COMPARED = (
    "The smaller AICc and BIC, the better a law describes the points for the numbers that it fits. A law whose AICc "
    "and BIC are more than 10 above the least is ruled out; of the others, the one that fits the fewest numbers is "
    "chosen. Errors of exponents hold for independent scatter."
)


def pick(dataset: xr.Dataset, choices: Sequence[str]) -> xr.Dataset:
    """The part of a result at some values of its axes, "mu=0.1" or "mu=6 degree/s^2" each, compared to six digits.

    Raises SweepError where there is no such axis, or it has no such value.
    """
    for choice in choices:
        name, equals, value = choice.partition("=")
        if not equals:
            raise SweepError(f'{choice}: expected axis=value, e.g. "mu=0.1" or "mu=6 degree/s^2"')
        one_of(name, [str(n) for n, c in dataset.coords.items() if c.ndim == 1], f"{choice}: no axis {name}")
        values, dim = dataset[name].values, str(dataset[name].dims[0])
        if values.dtype.kind in "fiu":
            try:
                wanted = measured(value, str(dataset[name].attrs.get("units", "1")), name)
            except ValueError as error:
                cause = error if isinstance(error, UnitMistake) else 'expected a number after =, or e.g. "3 degree"'
                raise SweepError(f"{choice}: {cause}") from None
            off = abs(values - np.clip(wanted, np.fmin.reduce(values), np.fmax.reduce(values)))
            # six digits are what `sweep show` and `sweep run` print
            order = np.argsort(off, kind="stable")
            found = order[np.isclose(values[order], wanted, rtol=1e-5, atol=0, equal_nan=True)]
            nearest = listed(f"{v:.6g}" for v in values[order[:2]])
        else:
            found = np.flatnonzero(values.astype(object) == value)
            nearest = listed(dict.fromkeys(map(str, values)), quote=True)
        if not len(found):
            raise SweepError(f"{choice}: {name} has no such value; nearest is {nearest}")
        dataset = dataset.isel({dim: found[0] if dim == name else found})
    return dataset


def output_of(dataset: xr.Dataset, y: str | None) -> str:
    """The output `y`, by default the one that is drawn. Raises SweepError where there is no such output."""
    outputs = [str(name) for name in dataset.data_vars if name not in ANCILLARY]
    return preferred(dataset, outputs) if y is None else one_of(y, outputs, f"--y {y}: no such output")


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

    @property
    def explanation(self) -> str:
        """What the columns mean."""
        return EXPLANATION.format(confidence=100 * self.confidence)


def laws(
    dataset: xr.Dataset,
    y: str | None,
    x: str,
    windows: Sequence[Sequence[float]] = (),
    confidence: float = 0.95,
    noise: bool | str | None = None,
) -> Laws:
    """What `sweep fit` finds; `y` and `noise` as of `output_of` and `fit_exponent`. Raises SweepError."""
    from sweep.laws.lines import fit_exponent
    from sweep.laws.two_laws import crossover, fit_two_laws

    y = output_of(dataset, y)
    if len(windows) > 2:
        raise SweepError(f"--window: expected one or two, found {len(windows)}")
    limits: list[Any] = sorted((low, high) for low, high in windows) or [None]
    column, keys, bend, meeting = dataset[y], {"confidence": confidence, "noise": noise}, None, None
    fits = tuple(fit_exponent(column, x, window, bound=dataset, **keys) for window in limits)  # type: ignore[arg-type]
    if len(fits) == 2:
        meeting = crossover(*fits).drop_dims("law")
    else:
        with contextlib.suppress(SweepError):  # of too few points
            found = fit_two_laws(column, x, limits[0], **keys)  # type: ignore[arg-type]
            bend = found if bool((found.regimes == 2).any()) else None
    remarks, parts = [str(dataset.attrs.get("lines", ""))], []
    if STATUS in dataset and column.dims == dataset[STATUS].dims:
        status, valued, words = dataset[STATUS].values, column.notnull().values, flag_words(dataset[STATUS])
        for code in np.unique(status[status != 0]).tolist():
            for cells, fate in ((valued, "in the fit"), (~valued, "left out")):
                if count := int((cells & (status == code)).sum()):
                    parts.append(f"{count} {words.get(code, code)} ({fate})")
        remarks += [f"Of {counted(status.size, 'cell')}: {', '.join(parts)}."] if parts else []
    return Laws(y, x, fits, bend, meeting, confidence, " ".join(filter(None, remarks)))


def law_tables(found: Laws, complete: bool = False) -> list[Table]:
    """Exponents and their intervals, a row for each line; optionally all columns."""

    def table(title: str, of: Sequence[xr.Dataset], heading: Sequence[str], cells: Any, keep: int | None) -> Table:
        """For each line its place on the other axes, and the first cells of what is fitted."""
        rows = [(place, cells(one)[:keep]) for fit in of for place, one in _lines(fit)]
        if len(rows) > MOST_ROWS:
            title += f"; {len(rows) - MOST_ROWS} more lines, choose with --at axis=value"
        texts = [(*place.values(), *fitted) for place, fitted in rows[:MOST_ROWS]]
        return Table(texts, (*rows[0][0], *heading[:keep]), title)

    heading = ("window", "p", "interval", "points", "drift", "residual", f"{found.y} at {found.x} = 1")
    tables = [table(f"{found.y} ~ {found.x}^p", found.fits, heading, _fit_cells, None if complete else 3)]
    if found.bend is not None:
        heading = ("p low", "interval", "p high", "interval", f"{found.x} between", "interval", "bend")
        tables.append(table("two laws with a smooth bend", [found.bend], heading, _bend_cells, None if complete else 5))
    if found.meeting is not None:
        tables.append(table("the two laws meet", [found.meeting], (found.x, "", found.y), _meeting_cells, None))
    return tables


def laws_text(found: Laws, complete: bool = False) -> str:
    """The laws as people read them; optionally all columns and what they mean."""
    tables = (table.text() for table in law_tables(found, complete))
    return page(*tables, *map(paragraph, (found.remark, found.explanation if complete else REST)))


def exponents_text(found: xr.Dataset, x: str, complete: bool = False) -> str:
    """Local exponents with their errors, a row a point: about `POINTS` of each line, optionally all."""
    along, place, rows = str(found[x].dims[0]), dict[str, str](), list[Sequence[str]]()
    for place, line in _lines(found, along):
        here = line.where(line.exponent.notnull(), drop=True)
        count = here.sizes[along]
        for point in range(count) if complete else np.unique(np.linspace(0, count - 1, min(POINTS, count), dtype=int)):
            at, exponent, error = (float(here[name][point]) for name in (x, "exponent", "exponent_error"))
            rows.append((*place.values(), f"{at:.6g}", f"{exponent:.6g}", f"{error:.1e}"))
    return Table(rows, (*place, x, "exponent", "error"), str(found.exponent.attrs["long_name"])).text()


def sensitivity_text(found: xr.Dataset) -> str:
    """Indices of `sensitivity`, a row a parameter."""
    rows = [(name, *(f"{value:.4g}" for value in values)) for name, *values in found.to_dataframe().itertuples()]
    return Table(rows, ("parameter", *(str(name).replace("_", " ") for name in found.data_vars))).text()


def write_laws(found: Laws, path: Path) -> None:
    """The laws as csv: a row for each line and window; of two laws a row each. Raises SweepError."""
    from pandas import DataFrame  # type: ignore[import-untyped]

    parts = [(fit, "one") for fit in found.fits]
    parts += [] if found.bend is None else [(found.bend.sel(law=law), law) for law in ("low", "high")]
    parts += [] if found.meeting is None else [(found.meeting, "meeting")]
    lines = ((law, *line) for fit, law in parts for line in _lines(fit))
    rows = [{"y": found.y, "x": found.x, "law": law} | place | _numbers(one) for law, place, one in lines]
    with disk.replacing(path) as part:
        DataFrame([{name: cell(value) for name, value in row.items()} for row in rows]).to_csv(part, index=False)


def _numbers(one: xr.Dataset) -> dict[str, Any]:
    return {str(name): variable.item() for name, variable in one.data_vars.items()}


def _lines(dataset: xr.Dataset, along: str = "law") -> Iterator[tuple[dict[str, str], xr.Dataset]]:
    """Each line's place on the other axes, as people write it (a number where it has no name), and what is of it."""
    dims = [str(dim) for dim in dataset.sizes if dim != along]
    for position in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        one = dataset.isel(dict(zip(dims, position, strict=True)))
        places = {dim: one[dim].item() if dim in one.coords else str(k) for dim, k in zip(dims, position, strict=True)}
        yield {dim: value if isinstance(value, str) else f"{value:.6g}" for dim, value in places.items()}, one


def _fit_cells(fit: xr.Dataset) -> tuple[str, ...]:
    v = _numbers(fit)
    if math.isnan(v["exponent"]):
        return "-", "-", v["kind"], f"{v['points']}", "-", "-", "-"
    low, high = v["exponent_low"], v["exponent_high"]
    # of an exponent that does not fit, as many digits as the range of the local one has in common
    digits = 8 if v["fits"] == 1 else 3 if abs(high - low) < 0.1 * abs(v["exponent"]) else 2
    interval = _interval(low, high) + ("" if v["fits"] == 1 else ", bent")
    window, rest = f"{v['low']:.4g} to {v['high']:.4g}", (f"{v['drift']:.1e}", f"{v['residual']:.1e}")
    return window, f"{v['exponent']:.{digits}g}", interval, f"{v['points']}", *rest, f"{v['prefactor']:.6g}"


def _interval(low: float, high: float) -> str:
    """Both ends, with as many digits as tell them apart, and two more."""
    apart, digits = abs(high - low), 8
    if math.isfinite(apart) and apart > 0:
        digits = max(3, min(2 - math.floor(math.log10(apart / max(abs(low), abs(high)))), 15))
    return f"{low:.{digits}g} to {high:.{digits}g}"


def _bend_cells(bend: xr.Dataset) -> tuple[str, ...]:
    if bend.regimes.item() != 2:
        return *("-",) * 4, bend.verdict.item(), "-", "-"
    cells = []
    for one, name in ((bend.sel(law="low"), "exponent"), (bend.sel(law="high"), "exponent"), (bend, "crossover")):
        cells += [f"{one[name].item():.6g}", _interval(one[f"{name}_low"].item(), one[f"{name}_high"].item())]
    return *cells, f"{bend.width.item():.2g} decades wide, residual {bend.residual.item():.1e}"


def _meeting_cells(meeting: xr.Dataset) -> tuple[str, ...]:
    v = _numbers(meeting)
    return f"{v['crossover']:.6g}", f"+- {v['crossover_error']:.1e}", f"{v['level']:.6g}"


def comparison(dataset: xr.Dataset, y: str | None, x: str, windows: Sequence[Sequence[float]] = ()) -> xr.Dataset:
    """`compare_laws` of one line of a result. Raises SweepError, also where other axes are left."""
    from sweep.laws.two_laws import compare_laws

    y = output_of(dataset, y)
    if len(windows) > 1:
        raise SweepError(f"--window: with --compare expected one, found {len(windows)}")
    rest = [str(dim) for dim in dataset[y].dims if x not in dataset.coords or dim not in dataset[x].dims]
    rest = [dim for dim in rest if dataset.sizes[dim] > 1]
    if rest:
        how = dataset.attrs.get("lines") or f"choose with --at {rest[0]}=value"
        raise SweepError(f"--compare: {y} also runs along {', '.join(rest)}; {how}")
    window = tuple(windows[0]) if windows else None
    return compare_laws(dataset[y].squeeze(), x, window)  # type: ignore[arg-type]


def comparison_text(found: xr.Dataset, complete: bool = False) -> str:
    """Which laws are ruled out, and the verdict; optionally all columns and what they mean."""
    from sweep.laws.noise import BEYOND_DOUBT

    rows = []
    for one in found.drop_dims("point").to_dataframe().reset_index().to_dict("records"):
        told = "ruled out" if one["worse"] > BEYOND_DOUBT else str(one["exponents"])
        more = (f"{one['bic'] - float(found.bic.min()):.4g}", str(one["numbers"])) if complete else ()
        rows.append((one["law"], f"{one['worse']:.4g}", *more, f"{one['residual']:.1e}", told))
    heading = ("law", "worse by", *(("BIC", "numbers") if complete else ()), "residual")
    title = f"{found.attrs['y']} over {found.attrs['x']}, {found.sizes['point']} points"
    notes = (f"Chosen: {found.attrs['verdict']}.", COMPARED if complete else "BIC and more, and what it means: --all.")
    return page(Table(rows, (*heading, "exponents"), title).text(), *map(paragraph, notes))
