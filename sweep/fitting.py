"""What `sweep fit` prints: power laws along one axis, one line for each combination of the other axes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.checks import did_you_mean, listed
from sweep.errors import SweepError
from sweep.layout import METHOD_USED, STATUS
from sweep.table import columns, page

if TYPE_CHECKING:
    import xarray as xr

MOST_ROWS = 40

EXPLANATION = (
    "+- is the standard error, taking the scatter about the line as noise; drift is how far the exponent changes "
    "across the window; residual is the largest relative distance of a point from the line"
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


def fit_text(dataset: xr.Dataset, y: str, x: str, windows: Sequence[Sequence[float]]) -> str:
    """Power laws y ~ x^p over each window, and where the laws of two windows meet. Raises SweepError."""
    from sweep.analysis import crossover, fit_exponent

    outputs = [str(name) for name in dataset.data_vars if name not in (STATUS, METHOD_USED)]
    if y not in outputs:
        hint = did_you_mean(y, outputs) or f"; there are {listed(outputs, word='and')}"
        raise SweepError(f"--y {y}: no such output{hint}")
    if len(windows) > 2:
        raise SweepError(f"--window: expected one or two, found {len(windows)}")
    limits: list[tuple[float, float] | None] = [*sorted((low, high) for low, high in windows)] or [None]
    fits = [fit_exponent(dataset[y], x, window) for window in limits]
    texts = [f"{y} ~ {x}^p", columns([_heading(fits[0]), *_rows(fits, _fit_cells)])]
    if len(fits) == 2:
        meeting = crossover(fits[0], fits[1])
        texts += ["the two laws meet", columns([(*_dims(meeting), x, "", y), *_rows([meeting], _meeting_cells)])]
    return page("\n".join(texts[:2]), "\n".join(texts[2:]), columns([(EXPLANATION,)], indent=""))


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


def _dims(dataset: xr.Dataset) -> list[str]:
    return [str(dim) for dim in dataset.sizes]


def _heading(fit: xr.Dataset) -> tuple[str, ...]:
    return (*_dims(fit), "window", "p", "", "points", "drift", "residual", "law")


def _rows(datasets: Sequence[xr.Dataset], cells: Any) -> Iterator[tuple[str, ...]]:
    """A line for each point of each Dataset, at most `MOST_ROWS` of them."""
    points = [point for dataset in datasets for point in _points(dataset)]
    for labels, point in points[:MOST_ROWS]:
        yield (*labels, *cells(point))
    if len(points) > MOST_ROWS:
        width = len(points[0][0]) + len(cells(points[0][1]))
        yield (*[""] * (width - 1), f"and {len(points) - MOST_ROWS} more; choose with --at axis=value")


def _points(dataset: xr.Dataset) -> Iterator[tuple[list[str], xr.Dataset]]:
    dims = _dims(dataset)
    for position in itertools.product(*(range(dataset.sizes[dim]) for dim in dims)):
        point = dataset.isel(dict(zip(dims, position, strict=True)))
        yield (
            [
                _label(point[dim].item()) if dim in point.coords else str(i)
                for dim, i in zip(dims, position, strict=True)
            ],
            point,
        )


def _label(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _fit_cells(fit: xr.Dataset) -> tuple[str, ...]:
    v = {str(name): variable.item() for name, variable in fit.data_vars.items()}
    law = f"{fit.attrs['y']} = {v['prefactor']:.6g} {fit.attrs['x']}^{v['exponent']:.6g}"
    return (
        f"{v['low']:.4g} to {v['high']:.4g}",
        f"{v['exponent']:.8g}",
        f"+- {v['exponent_error']:.1e}",
        f"{v['points']}",
        f"{v['drift']:.1e}",
        f"{v['residual']:.1e}",
        law,
    )


def _meeting_cells(meeting: xr.Dataset) -> tuple[str, ...]:
    v = {str(name): variable.item() for name, variable in meeting.data_vars.items()}
    return f"{v['abscissa']:.6g}", f"+- {v['abscissa_error']:.1e}", f"{v['ordinate']:.6g}"
