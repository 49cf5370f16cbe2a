"""Shared by all fits: the axis of the curves, windows, logarithms, lines of an array, and names of results."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable
from typing import Any

import numpy as np
import xarray as xr

from sweep.errors import SweepError
from sweep.laws.loglog import EPSILON, FEWEST, LINES, VALUES, Array, alike
from sweep.laws.noise import NOISES, roughness, rounding
from sweep.units import UnitMistake, in_unit, unit_of
from sweep.words import a_name, did_you_mean, kind, number

Window = tuple[float | None, float | None]

FEWEST_OF_LAW, PLACES_OF_LAW = 8, 6
"""Points, and different places among them, from which on laws with more numbers than a line are fitted."""
MANY = 10_000
"""Points that laws are fitted to of twice as many and more, where these are of a smooth curve and without noise."""
MOST_SIGMA = 1e6
"""Relative standard error beyond which logarithms are meaningless."""
FIELDS = {
    "exponent": "exponent of the power law",
    "x_exponent": "a of x / L^a",
    "y_exponent": "b of y / L^b",
    "crossover": "where the two laws meet",
    "crossover_error": "half of the interval of crossover",
    "verdict": "what the points say of the law",
    "kind": "what the distances of the points from the line are",
    "regimes": "how many laws are beyond doubt, and meet in the window; 0 where none is told",
    "evidence": "by how much AICc and BIC prefer two laws to one, whatever its noise, and to functions that are none",
    "exponent_error": "standard error of the exponent",
    "prefactor": "y at x = 1 on the line",
    "prefactor_error": "standard error of the prefactor",
    "correction_exponent": "D: how fast the correction fades; NaN where there is none",
    "correction": "B x^-D at the outer end of the window",
    "noisy": "1 where the interval is of noise, 0 where of error bounds or of how far smooth values bend",
    "fits": "1 where the law describes the points; where 0, an interval, if any, is only the range of the slope",
    "drift": "change of the exponent across the window, by a parabola",
    "width": "width of the bend, in decades",
    "aicc": "Akaike's criterion, corrected for few points; of one law with the noise that suits it best",
    "bic": "Bayes' criterion, likewise",
    "worse": "AICc above the least, or BIC, whichever is less; beyond 10 a law is ruled out",
    "numbers": "numbers that are fitted",
    "scatter": "relative distance of the points from the law, root mean square",
    "residual": "largest relative distance of a point from the law",
    "chi_squared": "chance that noise of the given sigma has so large a chi-squared; NaN without sigma",
    "formula": "y of x",
    "exponents": "exponents with their standard errors, as of independent noise",
    "points": "points in the fit",
    "dropped": "points that are missing or not positive, or lie where no other curve has any",
    "low": "first abscissa in the fit",
    "high": "last abscissa in the fit",
    "centre": "geometric mean of the abscissae",
    "level": "y on the line at the centre, or where two laws meet",
    "level_error": "relative standard error of the level",
    "start": "y at the first abscissa",
    "stop": "y at the last abscissa",
    "limit_low": "to where the local exponent tends below the window; no end of an interval; NaN where there is noise",
    "limit_high": "to where the local exponent tends above the window; no end of an interval; NaN where there is noise",
    "x": "places of the points",
    "y": "values of the points",
    "fitted": "the law at the points",
}
"""Numbers and words of all fits, in their order."""
IN_X = ("crossover", "crossover_error", "low", "high", "centre", "x")
IN_Y = ("prefactor", "prefactor_error", "level", "start", "stop", "y", "fitted")
"""Those with the unit of x, and with that of y; all others are numbers."""


def check_output(y: Any) -> None:
    """Raises SweepError where y is no DataArray of numbers."""
    if not isinstance(y, xr.DataArray):
        raise SweepError(f"expected one output, e.g. ds.period; found {kind(y)}")
    if y.dtype.kind not in "fiub":
        raise SweepError(f"{title(y)}: expected real numbers, found {y.dtype}")


def converted(what: str, value: Any, of: xr.DataArray) -> Any:
    """Numbers; those that have a unit themselves in the unit of an array, if it has one. Raises SweepError."""
    try:
        return in_unit(value, str(of.attrs.get("units") or unit_of(value)), what)
    except (TypeError, UnitMistake) as fault:
        raise SweepError(f"{what}: {fault}") from None


def check_options(confidence: float = 0.95, noise: bool | str | None = None, sigma: Any = None) -> None:
    """Raises SweepError where confidence is no share, or noise none of the words or given beside sigma."""
    if not 0 < number("confidence", confidence) < 1:
        raise SweepError(f"confidence: expected a number between 0 and 1, found {confidence}")
    words = [word for word in NOISES if word != "noise"]
    if not (noise is None or isinstance(noise, bool) or (isinstance(noise, str) and noise in words)):
        raise SweepError(f"noise: expected True, False or one of {', '.join(words)}; found {noise!r}")
    if noise is not None and sigma is not None:
        raise SweepError("noise and sigma exclude each other; give one of them")


def check_names(y: xr.DataArray, taken: Iterable[Hashable]) -> None:
    """Raises SweepError where axes of y have names that the result uses itself."""
    if names := sorted(map(str, taken)):
        raise SweepError(
            f"{title(y)} has an axis {names[0]!r}, and so has the result, of another meaning; rename it first, e.g. "
            f"y.rename({names[0]}='{names[0]}_of_y')"
        )


def positive_axis(y: xr.DataArray, dim: str, repeated: bool = False) -> tuple[str, Array]:
    """Dimension that `dim` runs along, and its values, fit to take logarithms of; some may be `repeated`."""
    check_output(y)
    a_name("dim", dim)
    axes = [str(name) for name, coordinate in y.coords.items() if coordinate.ndim == 1]
    if dim not in axes:
        others = f"; {title(y)} runs along {', '.join(axes) or 'no axis with values'}"
        if str(dim) in y.coords:
            found = "runs along several dimensions" if y.coords[dim].ndim else "has one value here"
            raise SweepError(f"{dim} {found}, so nothing can be fitted along it{others}")
        raise SweepError(f"{title(y)} has no axis {dim!r}" + (did_you_mean(str(dim), axes) or others))
    values = y.coords[dim].values
    if values.size < FEWEST:
        raise SweepError(f"{dim} has only {values.size} points; an exponent needs at least {FEWEST} points")
    first, of = values[:1].tolist()[0], values.dtype
    if of.kind in "mM" or hasattr(first, "calendar"):  # cftime's
        since = f", {dim}" if of.kind == "m" else f" since a moment before the first, ({dim} - MOMENT)"
        raise SweepError(f"{dim} holds times, not numbers; take seconds{since} / np.timedelta64(1, 's')")
    if of.kind not in "fiu":
        held = "words" if isinstance(first, str) else f"{of} values such as {first}"
        raise SweepError(f"{dim} holds {held}, not numbers; a power law needs a number axis")
    x = values.astype(np.float64)
    fit = np.isfinite(x) & (x > 0)
    if not fit.all():
        raise SweepError(f"{dim} must be positive and finite to take logarithms; found {x[~fit][0]:g}, select a part")
    steps = np.diff(x)
    if not ((steps >= 0).all() or (steps <= 0).all()):
        raise SweepError(f"{dim} is not monotone; sort first, e.g. ds.sortby({dim!r})")
    if not (repeated or steps.all()):
        twice = f"{dim} = {x[:-1][steps == 0][0]:g} stands there more than once"
        raise SweepError(f"{twice}; take means first, e.g. ds.groupby({dim!r}).mean()")
    return str(y.coords[dim].dims[0]), x


def limits(window: Window | None, axis: xr.DataArray) -> tuple[float, float]:
    """Ends of a window in the unit of its axis, 0 and infinity where open; what is an end up to rounding is inside."""
    try:
        low, high = (None, None) if window is None else (converted("window", end, axis) for end in window)
        low, high = 0.0 if low is None else float(low), math.inf if high is None else float(high)
    except (TypeError, ValueError):
        what = f"a window of {axis.name} is a pair (low, high) of numbers or None"
        raise SweepError(f"{what}; found {window!r}") from None
    if not low < high:
        raise SweepError(f"the window {low:g} to {high:g} of {axis.name} is empty; give (low, high) with low < high")
    return low * (1 - 8 * EPSILON), high * (1 + 8 * EPSILON)


def title(y: xr.DataArray) -> str:
    return str(y.name) if y.name is not None else "the array"


def log_of(y: xr.DataArray, values: bool = False) -> xr.DataArray:
    """Natural logarithm, or the values themselves; NaN where there is none."""
    numbers = y.astype(np.float64)
    numbers = numbers.where(np.isfinite(numbers) & (values | (numbers > 0)))
    return numbers if values else numbers.copy(data=np.log(numbers.data))


def fit_lines(
    function: Callable[..., Any], law: str, y: Any, dim: str, window: Window | None, sigma: Any, **options: Any
) -> xr.Dataset:
    """What a function finds of each line of y in a window, described, with `points`, how many of its values are there.

    `function` of ln x (n,), rising, of ln y of m lines without gaps (m, n), of their `sigma`, relative standard errors,
    and `bound` likewise, if given, and of the options gives numbers and words (m,) by name, or those of each line; of
    two laws (m, 2); or, of one line alone, what becomes the result. With `bound`, for a straight line, three points at
    two places are enough. Of lines that are not positive, or have too few points, the numbers are NaN and the words
    say so; raises SweepError where that is so of all lines.
    """
    bound = options.pop("bound", None)
    fewest, fewest_places = (FEWEST_OF_LAW, PLACES_OF_LAW) if bound is None else (FEWEST, 2)
    check_options(sigma=sigma, **options)
    dimension, x = positive_axis(y, dim, repeated=True)
    low, high = limits(window, y.coords[dim])
    places = np.flatnonzero((x >= low) & (x <= high))
    places = places[np.argsort(x[places], kind="stable")]
    part, t = y.isel({dimension: places}).transpose(..., dimension), np.log(x[places])
    rows, shape = dict[str, Array](), (math.prod(part.shape[:-1]), t.size)
    for name, one in {"z": y, "bound": bound, "sigma": None if sigma is None else relative_sigma(y, sigma)}.items():
        if one is not None:
            ordered = one.isel({dimension: places}).transpose(..., dimension)
            rows[name] = ordered.values.astype(np.float64).reshape(shape)
    values = np.where(np.isfinite(rows["z"]), rows["z"], np.nan)
    bad = np.asarray((values <= 0).any(axis=1))
    if bad.size and bad.all():
        line, place = np.argwhere(values <= 0)[0]
        raise SweepError(
            f"a power law needs positive values; {(values <= 0).sum()} of {values.size} of {title(y)} in the window are"
            f" not, e.g. {values[line, place]:g} at {dim} = {x[places][place]:g}; choose a window without them"
        )
    with np.errstate(all="ignore"):
        rows["z"] = np.where(bad[:, None], np.nan, np.log(values))
    present = np.isfinite(rows["z"]) & np.isfinite(rows.get("sigma", 0.0))
    unfit, columns = np.where(bad, "not positive", "too few points").astype(object), dict[str, Any]()
    for pattern, which in alike(present, max(LINES, VALUES // max(1, t.size))):
        if pattern.sum() < fewest or np.unique(t[pattern]).size < fewest_places:
            continue
        s, lines = t[pattern], {name: one[which][:, pattern] for name, one in rows.items()}
        if len(lines) == 1 and s.size > 2 * MANY and (roughness(s, **lines)[0] <= 8 * rounding(s, **lines)).all():
            some = np.linspace(0, s.size - 1, MANY).round().astype(int)
            s, lines = s[some], {"z": lines["z"][:, some]}
        with np.errstate(all="ignore"):  # what overflows is infinite
            result = function(s, **lines, **options)
        if isinstance(result, xr.Dataset):
            return described(result.assign_attrs(y=title(y), x=dim), y.coords[dim], y)
        if not isinstance(result, dict):
            result = {name: np.array([one[name] for one in result]) for name in result[0]}
        for name, column in result.items():
            empty = unfit.copy() if column.dtype.kind == "U" else np.full((len(bad), *column.shape[1:]), np.nan)
            columns.setdefault(name, empty)[which] = column
    columns["points"] = present.sum(axis=1)
    if len(columns) == 1:
        where, way = "", "add points"
        if window is not None:
            ends = ("open" if end in (0.0, math.inf) else f"{end:g}" for end in (low, high))
            where, way = f" in the window {' to '.join(ends)}", "choose a wider one"
        raise SweepError(
            f"a fit of {title(y)} needs at least {fewest} points at {fewest_places} values of {dim}, found "
            f"{columns['points'].max(initial=0)} at {np.unique(t[present.any(axis=0)]).size}{where}; {way}"
        )
    coords: dict[Any, Any] = {name: one for name, one in part.coords.items() if dimension not in one.dims}
    check_names(y, {*coords, *part.dims[:-1]} & {*columns})
    for name, column in columns.items():
        column = column.astype(str) if column.dtype == object else column
        dims = ("law",) * (column.ndim - 1) + part.dims[:-1]
        coords |= {"law": ["low", "high"]} if column.ndim > 1 else {}
        columns[name] = dims, column.T.reshape(column.shape[1:] + part.shape[:-1])
    attrs = {"law": law.format(y=title(y), x=dim), "y": title(y), "x": dim, "confidence": options.get("confidence")}
    return described(xr.Dataset(columns, coords, attrs), y.coords[dim], y)


def like(given: Any, y: xr.DataArray, what: str) -> xr.DataArray:
    """A number or DataArray as one of the shape of y. Raises SweepError where it is negative or does not fit."""
    try:
        array: xr.DataArray = (xr.zeros_like(y, dtype=np.float64) + given).astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        array = xr.DataArray(math.nan)
    if array.dims != y.dims or array.shape != y.shape:
        raise SweepError(f"{what}: expected a number, or an array along axes of {title(y)}; found {kind(given)}")
    if bool((array < 0).any()):
        raise SweepError(f"{what}: errors are not negative; found {float(array.min()):g}")
    return array


def relative_sigma(y: xr.DataArray, sigma: Any) -> xr.DataArray:
    """Standard errors over y; NaN where none are given or y is not positive. Raises SweepError for those that are not
    above rounding."""
    given = np.nan if sigma is None else converted("sigma", sigma, y)
    errors: xr.DataArray = like(given, y, "sigma") / y.where((y > 0) & np.isfinite(y)).astype(np.float64)
    beyond = errors.where((errors < EPSILON) | (errors > MOST_SIGMA))
    if bool(beyond.notnull().any()):
        worst = float(beyond.min())
        raise SweepError(
            f"sigma: expected standard errors of {EPSILON:.2g} to {MOST_SIGMA:.2g} times {title(y)}, found {worst:.3g} "
            "times; leave sigma out where values do not scatter"
        )
    return errors


def stated_bound(y: xr.DataArray, bound: Any = None) -> xr.DataArray:
    """Largest relative error of each value: as given, or as a result states it for y; else y's `rtol`, else 0; and what
    rounding to fewer digits than double precision adds."""
    check_output(y)
    if isinstance(bound, xr.Dataset):
        if title(y) not in bound:
            raise SweepError(f"bound: this Dataset has no {title(y)}")
        rtol = bound["rtol"] if "rtol" in bound.coords else float(bound.attrs.get("rtol", 0.0))
        wanted, stated = like(rtol, bound[title(y)], "rtol"), bound.get("error_bound", rtol)
        bound = wanted.where(~(stated > wanted), stated)  # more where a cell is INACCURATE
    error = like(y.attrs.get("rtol", 0.0) if bound is None else bound, y, "bound")
    few_digits = y.dtype.kind == "f" and y.dtype.itemsize < 8
    rounded = float(np.finfo(y.dtype).eps) / 2 if few_digits else 0.0
    return error.where(np.isfinite(error), 1.0) + rounded  # of an error that is not known a value is worth nothing


def described(result: xr.Dataset, x: xr.DataArray, y: xr.DataArray) -> xr.Dataset:
    """A result with its variables in the order of FIELDS, each followed by the ends of its interval where there is one,
    with units and long names; and a summary: a table of intervals and words, a row for each line."""
    names = [name for name in FIELDS if name in result]
    ends = {name: [f"{name}_low", f"{name}_high"] if f"{name}_low" in result else [] for name in names}
    result = result[[one for name in ends for one in (name, *ends[name])]]
    own = {key: str(given.attrs.get("long_name", given.name)) for key, given in (("x", x), ("y", y)) if given.name}
    for name in ends:
        unit = (x if name in IN_X else y).attrs.get("units", "1") if name in IN_X + IN_Y else "1"
        words = own.get(name, FIELDS[name]), *(f"{end} end of the interval of {name}" for end in ("low", "high"))
        for one, text in zip((name, *ends[name]), words, strict=False):
            result.variables[one].attrs = {"units": str(unit), "long_name": text}
    if any(ends.values()):
        columns = [one for name in ends if ends[name] for one in (name, *ends[name])]
        columns += [name for name in ends if result[name].dtype.kind == "U"]
        table = result[columns] if result[columns].sizes else result[columns].expand_dims("line")
        rows = table.to_dataframe()[columns].reset_index()
        result.attrs["summary"] = rows.to_string(index=False, max_rows=20, float_format="{:.6g}".format)
    return result
