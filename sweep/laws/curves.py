"""What all analysis of curves shares: the axis they run along, windows of it, logarithms, and lines of an array."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sweep.errors import SweepError
from sweep.laws.loglog import EPSILON, FEWEST, Array
from sweep.words import kind, require_dataset

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


def positive_axis(y: xr.DataArray, dim: str) -> tuple[str, Array]:
    """Dimension that `dim` runs along, and its values, fit to take logarithms of."""
    dimension, values = _coordinate(y, dim)
    if values.dtype.kind not in "fiu":
        raise SweepError(f"{dim} holds words, not numbers; a power law needs a number axis")
    x = values.astype(np.float64)
    fit = np.isfinite(x) & (x > 0)
    if not fit.all():
        raise SweepError(f"{dim} must be positive and finite to take logarithms; found {x[~fit][0]:g}, select a part")
    if x.size < FEWEST:
        raise SweepError(f"{dim} has {x.size} of the at least {FEWEST} points that an exponent needs")
    rises = np.diff(x) > 0
    if not ((rises.all() or not rises.any()) and np.diff(x).all()):
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


def window_logs(y: xr.DataArray, dim: str, window: Window | None) -> tuple[str, Array, xr.DataArray]:
    """Dimension that `dim` runs along, ln dim inside the window, and ln y there. Raises SweepError."""
    here = window_of(y, dim, window)
    ((dimension, inside),) = here.items()
    return dimension, np.log(positive_axis(y, dim)[1][inside]), logarithm(y.isel(here), dim)


def window_of(y: xr.DataArray, dim: str, window: Window | None) -> dict[str, NDArray[np.intp]]:
    """What `isel` takes for the window."""
    dimension, x = positive_axis(y, dim)
    return {dimension: np.flatnonzero(inside_window(x, window, dim))}


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


def logarithm(part: xr.DataArray, dim: str) -> xr.DataArray:
    """Natural logarithm, NaN where a point is missing. Raises SweepError where a point is not positive."""
    cells = np.argwhere(np.asarray(part.values <= 0))
    if count := len(cells):
        first = part[tuple(cells[0])]
        raise SweepError(
            f"a power law needs positive values; {count} of {part.size} of {title(part)} in the window are not, "
            f"e.g. {float(first):g} at {dim} = {float(first.coords[dim]):g}; choose a window without them"
        )
    return log_of(part)


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
        found = found.where(stated.isnull(), stated)
    return found.transpose(*dataset[name].dims)


def scatter_is_noise(off: Array, z: Array) -> Any:
    """Whether distances from a curve look like independent noise rather than a bend, lines along the last axis.

    Neighbours of independent noise differ by sqrt(2) times its size: von Neumann's ratio is 2 +- 2/sqrt(n). Those of a
    smooth bend differ by far less; and what rounding leaves is no noise. Missing points are passed over.
    """
    rows = [row[np.isfinite(row)] for row in off.reshape(-1, off.shape[-1])]
    least = np.array([max(1.0, 2.0 - 6.0 / math.sqrt(row.size or 1)) for row in rows])  # one set of noise in 1000
    ratio = np.array([(np.diff(row) ** 2).sum() for row in rows]) > least * np.array([(row**2).sum() for row in rows])
    size = np.array([math.sqrt((row**2).mean()) if row.size else 0.0 for row in rows])
    rounding = 8 * EPSILON * (1.0 + np.nanmax(abs(z), axis=-1, initial=0.0))
    return (ratio & (size > rounding.reshape(-1))).reshape(off.shape[:-1])


def noise_of(off: Array) -> float:
    """Size of the noise on one smooth line without gaps: the least of what its differences of order 2 to 10 leave.

    Noise leaves the same in all orders; a bend ever less, the higher the order.
    """
    orders = range(2, min(10, off.size - 4) + 1)
    sizes = [float(np.sqrt(np.mean(np.diff(off, k) ** 2) / math.comb(2 * k, k))) for k in orders]
    return min(sizes, default=math.inf)
