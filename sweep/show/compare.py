"""What `sweep fit --compare` prints: which laws describe one line, and which are ruled out."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sweep.errors import SweepError
from sweep.file import disk
from sweep.show.laws import output_of
from sweep.words import cell, columns, page, paragraph

if TYPE_CHECKING:
    import xarray as xr

NOTE = (
    "AICc is less, the better a law describes the points for its numbers; one that is worse by more than 10 is ruled "
    "out, and of the others the one with the fewest numbers is chosen. Errors of exponents are as of independent "
    "scatter. A chance of its runs of signs below 0.001 says that a law misses the points systematically."
)


def comparison(dataset: xr.Dataset, y: str | None, x: str, windows: Sequence[Sequence[float]] = ()) -> xr.Dataset:
    """`compare_laws` of one line of a result. Raises SweepError, also where other axes are left."""
    from sweep.laws.compare import compare_laws

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


def comparison_text(found: xr.Dataset) -> str:
    """The table, the verdict, and what the columns mean."""
    rows = [("law", "AICc worse by", "BIC", "numbers", "residual", "chance of runs", "exponents")]
    best = float(found.bic.min())
    for i in range(found.sizes["law"]):
        one = found.isel(law=i)
        ruled_out = one.worse.item() > 10
        rows.append(
            (
                str(one.law.item()),
                f"{one.worse.item():.4g}",
                f"{one.bic.item() - best:.4g}",
                str(one.numbers.item()),
                f"{one.residual.item():.1e}",
                _chance(one.runs.item()),
                "ruled out" if ruled_out else str(one.exponents.item()),
            )
        )
    heading = f"{found.attrs['y']} over {found.attrs['x']}, {found.sizes['point']} points"
    return page(f"{heading}\n{columns(rows)}", paragraph(f"Chosen: {found.attrs['verdict']}."), paragraph(NOTE))


def _chance(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.2g}" if value >= 1e-4 else "< 1e-4"


def write_comparison(found: xr.Dataset, path: Path) -> None:
    """The table as csv, a row for each law. Raises SweepError."""
    names = [str(name) for name, variable in found.data_vars.items() if variable.dims == ("law",)]
    with disk.replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["y", "x", "law", "chosen", *names])
        for i in range(found.sizes["law"]):
            one = found.isel(law=i)
            law = str(one.law.item())
            row = [found.attrs["y"], found.attrs["x"], law, int(law == found.attrs["chosen"])]
            writer.writerow([cell(value) for value in (*row, *(one[name].item() for name in names))])
