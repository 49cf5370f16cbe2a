"""What all analysis of curves shares: the axis they run along, windows of it, logarithms, and lines of an array."""

from __future__ import annotations

import difflib
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sweep.errors import SweepError
from sweep.laws.loglog import EPSILON, FEWEST, Array
from sweep.words import Table, kind, require_dataset

Window = tuple[float | None, float | None]


def check_output(y: Any) -> None:
    """Raises SweepError where y is no DataArray of numbers."""
    if not isinstance(y, xr.DataArray):
        raise SweepError(f"expected one output, e.g. ds.period; found {kind(y)}")
    if y.dtype.kind not in "fiub":
        raise SweepError(f"{title(y)}: expected real numbers, found {y.dtype}")


def check_dataset(name: str, given: Any, maker: str = "", needs: Sequence[str] = ()) -> None:
    """Raises SweepError where what `sweep.name` was given is no Dataset with these variables; `maker` gives one."""
    require_dataset(name, given, maker)
    missing = [variable for variable in needs if variable not in given]
    if missing:
        raise SweepError(f"sweep.{name}: this Dataset has no {', '.join(map(str, missing))}")


def positive_axis(y: xr.DataArray, dim: str, repeated: bool = False) -> tuple[str, Array]:
    """Dimension that `dim` runs along, and its values, fit to take logarithms of; some may be `repeated`."""
    dimension, values = _coordinate(y, dim)
    if values.dtype.kind in "mM":
        times = f"{dim} - {dim}[0]" if values.dtype.kind == "M" else dim
        raise SweepError(f"{dim} holds times, not numbers; take seconds, ({times}) / np.timedelta64(1, 's')")
    if values.dtype.kind not in "fiu":
        raise SweepError(f"{dim} holds words, not numbers; a power law needs a number axis")
    x = values.astype(np.float64)
    fit = np.isfinite(x) & (x > 0)
    if not fit.all():
        raise SweepError(f"{dim} must be positive and finite to take logarithms; found {x[~fit][0]:g}, select a part")
    if x.size < FEWEST:
        raise SweepError(f"{dim} has {x.size} of the at least {FEWEST} points that an exponent needs")
    steps = np.diff(x)
    if not (((steps >= 0).all() or (steps <= 0).all()) and (repeated or steps.all())):
        raise SweepError(f"{dim} neither rises nor falls throughout; sort first, e.g. ds.sortby({dim!r})")
    return dimension, x


def _coordinate(y: xr.DataArray, dim: str) -> tuple[str, NDArray[Any]]:
    check_output(y)
    known = [str(name) for name, coordinate in y.coords.items() if coordinate.ndim == 1]
    if dim in known:
        return str(y.coords[dim].dims[0]), y.coords[dim].values
    there = f"{title(y)} runs along {', '.join(known)}" if known else f"{title(y)} runs along no axis with values"
    if dim in y.coords:
        raise SweepError(f"{dim} has one value here, so nothing can be fitted along it; {there}")
    close = difflib.get_close_matches(str(dim), known, 1)
    raise SweepError(f"{title(y)} has no axis {dim!r}; " + (f"did you mean {close[0]}?" if close else there))


def window_logs(
    y: xr.DataArray, dim: str, window: Window | None, repeated: bool = False
) -> tuple[dict[str, NDArray[np.intp]], Array, xr.DataArray, xr.DataArray]:
    """What `isel` takes for the window, ln dim and ln y there, and whether a line is positive; others are NaN.

    Raises SweepError where no line is.
    """
    dimension, x = positive_axis(y, dim, repeated)
    here = {dimension: np.flatnonzero(inside_window(x, window, dim))}
    part = y.isel(here).compute()
    bad = missing_is_nan(part) <= 0
    positive = ~bad.any(dimension)
    if not bool(positive.any()):
        first = part[tuple(np.argwhere(bad.values)[0])]
        raise SweepError(
            f"a power law needs positive values; {int(bad.sum())} of {part.size} of {title(y)} in the window are not, "
            f"e.g. {float(first):g} at {dim} = {float(first.coords[dim]):g}; choose a window without them"
        )
    return here, np.log(x[here[dimension]]), log_of(part).where(positive), positive


def check_confidence(confidence: float) -> None:
    """Raises SweepError where it is no share."""
    if not 0 < confidence < 1:
        raise SweepError(f"confidence: expected a number between 0 and 1, found {confidence}")


def check_end(name: str, end: str) -> None:
    """Raises SweepError where it is neither end of a window."""
    if end not in ("low", "high"):
        raise SweepError(f'{name}: expected "low" or "high", found {end!r}')


def inside_window(x: Array, window: Window | None, dim: str) -> NDArray[np.bool_]:
    low, high = ends(window, dim)
    # an end that is a grid point up to rounding is meant to be in
    return (x >= low * (1 - 8 * EPSILON)) & (x <= high * (1 + 8 * EPSILON))


def ends(window: Window | None, dim: str) -> tuple[float, float]:
    try:
        low, high = (None, None) if window is None else window
        ends = 0.0 if low is None else float(low), math.inf if high is None else float(high)
    except (TypeError, ValueError):
        raise SweepError(f"a window of {dim} is a pair (low, high) of numbers or None; found {window!r}") from None
    if not ends[0] < ends[1]:
        raise SweepError(f"the window {ends[0]:g} to {ends[1]:g} of {dim} is empty; give (low, high) with low < high")
    return ends


def title(y: xr.DataArray) -> str:
    return str(y.name) if y.name is not None else "the array"


def missing_is_nan(y: xr.DataArray) -> xr.DataArray:
    check_output(y)
    numbers = y.astype(np.float64)
    return numbers.where(np.isfinite(numbers))


def log_of(y: xr.DataArray) -> xr.DataArray:
    """Natural logarithm, NaN where there is none."""
    numbers = missing_is_nan(y)
    logs: xr.DataArray = xr.apply_ufunc(np.log, numbers.where(numbers > 0), dask="allowed", keep_attrs=True)
    return logs.rename(y.name)


def along(
    function: Callable[..., Array], y: xr.DataArray, dimension: str, to: str | None = None, *others: xr.DataArray
) -> xr.DataArray:
    """`function` of the last axis, put along `dimension`: in its place, or as a new last dimension `to`.

    `others` have the shape of `y`, and are further arguments.
    """
    found: xr.DataArray = xr.apply_ufunc(
        function,
        y.compute(),
        *(other.compute() for other in others),
        input_core_dims=[[dimension]] * (1 + len(others)),
        output_core_dims=[[to or dimension]],
        exclude_dims={dimension} if to else set(),
        keep_attrs=True,  # those of the coordinates; the caller writes those of the result
    )
    return found if to else found.transpose(*y.dims)


def numbers_along(
    names: Sequence[str], function: Callable[..., Array], y: xr.DataArray, dimension: str, *others: xr.DataArray
) -> xr.Dataset:
    """Numbers that a function puts in place of the points of each line, under these names."""
    numbers = along(function, y, dimension, "number", *others)
    return xr.Dataset({name: numbers.isel(number=k, drop=True) for k, name in enumerate(names)})


FEWEST_OF_LINE = 8
"""Points from which on laws with more numbers than a line are fitted."""


def fits_by_line(
    names: Sequence[str],
    function: Callable[[Array, Array, Array | None], Sequence[float]],
    y: xr.DataArray,
    dim: str,
    window: Window | None,
    sigma: Any,
) -> xr.Dataset:
    """Numbers that a function of ln x, ln y and weights (n,), x rising and none missing, gives for each line.

    NaN where there are too few points; raises SweepError where that is so of all lines.
    """
    here, t, logs, positive = window_logs(y, dim, window, repeated=True)
    ((dimension, _),) = here.items()

    def one(z: Array, errors: Array) -> Array:
        present = np.flatnonzero(np.isfinite(z) & (np.isfinite(errors) | (sigma is None)))
        present = present[np.argsort(t[present], kind="stable")]
        if present.size < FEWEST_OF_LINE or not np.ptp(t[present]) > 0:
            return np.full(len(names), np.nan)
        with np.errstate(all="ignore"):  # what overflows is infinite
            weights = None if sigma is None else errors[present] ** -2.0
            return np.array(function(t[present], z[present], weights), np.float64)

    errors, axes = relative_sigma(y, sigma).isel(here).compute(), [[dimension], [dimension]]
    numbers = xr.apply_ufunc(
        one, logs, errors, input_core_dims=axes, output_core_dims=[["number"]], vectorize=True, keep_attrs=True
    )
    if not bool(numbers.notnull().any()):
        raise SweepError(f"this needs at least {FEWEST_OF_LINE} points of {title(y)} in the window; widen it")
    found = xr.Dataset({name: numbers.isel(number=k, drop=True) for k, name in enumerate(names)})
    return found.assign(verdict=found.verdict.where(positive, NOT_POSITIVE))


NOT_POSITIVE = -2
"""Stands for the word in numbers."""


def in_words(codes: xr.DataArray, words: Sequence[str]) -> tuple[Any, NDArray[Any]]:
    """The words that numbers stand for; NaN is a line of too few points."""
    every = np.array([*words, "not positive", "too few points"])
    return codes.dims, every[codes.fillna(-1).values.astype(np.int64)]


def like(given: Any, y: xr.DataArray, what: str) -> xr.DataArray:
    """A number or DataArray as one of the shape of y. Raises SweepError where it is negative or does not fit."""
    try:
        found: xr.DataArray = xr.zeros_like(y, dtype=np.float64) + given
        fits = found.dims == y.dims and found.shape == y.shape
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise SweepError(
            f"{what}: expected a number, or an array along axes of {title(y)}; found {type(given).__name__}"
        )
    if bool((found < 0).any()):
        raise SweepError(f"{what}: errors are not negative; found {float(found.min()):g}")
    return found


MOST_SIGMA = 1e6
"""Relative standard error beyond which a logarithm says nothing."""


def relative_sigma(y: xr.DataArray, sigma: Any) -> xr.DataArray:
    """Standard errors over y; NaN where none are given. Raises SweepError where they are not above rounding."""
    found: xr.DataArray = like(np.nan if sigma is None else sigma, y, "sigma") / abs(y)
    beyond = found.where((found < EPSILON) | (found > MOST_SIGMA))
    if bool(beyond.notnull().any()):
        worst = float(beyond.min())
        raise SweepError(
            f"sigma: expected standard errors of {EPSILON:.2g} to {MOST_SIGMA:.2g} times {title(y)}, found {worst:.3g} "
            "times; leave sigma out where values do not scatter"
        )
    return found


def stated_bound(y: xr.DataArray, bound: Any = None) -> xr.DataArray:
    """Largest relative error of each value: as given, or as a result states it for y; else y's `rtol`, else 0."""
    check_output(y)
    if isinstance(bound, xr.Dataset):
        bound = stated_error(bound, title(y))
    found = like(y.attrs.get("rtol", 0.0) if bound is None else bound, y, "bound")
    return found.where(np.isfinite(found), 1.0)  # of an error that is not known a value is worth nothing


def stated_error(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Relative error that a result states for each value of an output: `rtol`, or `error_bound` where it is INACCURATE.

    Parameters
    ----------
    dataset : Dataset
        From `run` or `open_result`.
    name : str
        Output.

    Returns
    -------
    DataArray
        Of the output's shape; 0 where nothing is stated, inf where no error is known.
    """
    check_dataset("fit_exponent", dataset, needs=[name])
    rtol = dataset["rtol"] if "rtol" in dataset.coords else float(dataset.attrs.get("rtol", 0.0))
    found = like(rtol, dataset[name], "rtol")
    if "error_bound" in dataset:
        stated = dataset["error_bound"].astype(np.float64)
        found = found.where(~(stated > found), stated)
    return found.transpose(*dataset[name].dims)


MOST_ROWS = 20
"""Lines of a summary."""


def described(
    found: xr.Dataset, names: dict[str, str], units: dict[str, str], attrs: dict[str, Any], confidence: float
) -> xr.Dataset:
    """A result with its variables in the order of their names, with units and long names, and a summary."""
    found = found[list(names)]
    for name, words in names.items():
        found[name].attrs = {"units": units.get(name, "1"), "long_name": words}
    found.attrs = {**attrs, "confidence": confidence}
    found.attrs["summary"] = summary(found)
    return found


def summary(found: xr.Dataset) -> str:
    """A table of numbers with their intervals, and of words: a row for each line."""
    numbers = [str(name) for name in found.data_vars if f"{name}_low" in found]
    words = [str(name) for name, variable in found.data_vars.items() if variable.dtype.kind == "U"]
    table = found[[*words, *(name + end for name in numbers for end in ("", "_low", "_high"))]]
    dims, rows = list(table.sizes), []
    for place in itertools.islice(np.ndindex(*table.sizes.values()), MOST_ROWS):
        one = table.isel(dict(zip(dims, place, strict=True)))
        labels = [one[dim].item() if dim in one.coords else place[i] for i, dim in enumerate(dims)]
        values = [[float(one[name + end]) for end in ("", "_low", "_high")] for name in numbers]
        texts = [f"{value:.6g} ({low:.6g} to {high:.6g})" for value, low, high in values]
        rows.append((*(f"{one:.6g}" if isinstance(one, float) else str(one) for one in labels), *texts))
        rows[-1] += tuple(str(one[word].item()) for word in words)
    more = math.prod(table.sizes.values()) - len(rows)
    heading = (*map(str, dims), *(f"{name} ({100 * found.attrs['confidence']:g} %)" for name in numbers), *words)
    return Table(rows, heading).text(indent="", wide=True) + f"\nand {more} more" * (more > 0)
