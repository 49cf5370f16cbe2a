"""How many masses does a drivetrain need to hold its frequencies to 1 % up to a given band, by each method?

    python studies/fewest_masses.py [drivetrains]

makes random drivetrains of ten masses (400 unless told otherwise), reduces each by every method for bands that hold its
first 1 to 8 frequencies, prints what they need, and draws fewest_masses.png here. What comes out:

- modal reduction needs as many masses as there are frequencies in the band;
- IRS needs 0.3 more in the mean, Craig-Bampton 0.4 more (one more in a narrow band), Guyan 1.4 more;
- Rivin's chain needs 2.6 more, and all but all of ten where the band holds six: that is the price of staying a chain.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, columns, table

import sweep

METHODS = ("rivin", "guyan", "irs", "craig_bampton", "modal")
MASSES, SPREAD, TOLERANCE = 10, 100.0, 0.01
INSIDE = tuple(range(1, 9))
"""Frequencies that the band holds."""


def drivetrains(count: int, seed: int = 1) -> dict[str, np.ndarray]:
    """Random chains: inertias and stiffnesses evenly over the logarithm of a factor SPREAD, zeta about 1 %."""
    random = np.random.default_rng(seed)
    J, k = (SPREAD ** random.uniform(0, 1, (count, MASSES)) for _ in range(2))
    return {"J": J, "k": k, "h": 0.01 * np.sqrt(J * k)}


def swept(chains: dict[str, np.ndarray], outputs: list[str], reduction: str = "none", **more: Any) -> xr.Dataset:
    """One cell a chain; what else differs from cell to cell is in `more`."""
    fixed = {"tol": TOLERANCE, "reduction": reduction}
    axes = {name: values.tolist() for name, values in (chains | more).items()}
    study = sweep.build_study(kernel="drivetrain", design="zip", rtol=1e-7, outputs=outputs, axes=axes, fixed=fixed)
    return sweep.run(study)


def bands(chains: dict[str, np.ndarray]) -> np.ndarray:
    """Bands [Hz] that just hold the first of INSIDE frequencies, shape (drivetrains, len(INSIDE))."""
    f = swept(chains, ["frequency"]).frequency.values
    return f[:, [m - 1 for m in INSIDE]] * (1 + 1e-9)


def needed(chains: dict[str, np.ndarray]) -> xr.Dataset:
    """Masses kept and error of the receptance over (method, drivetrain, inside), and seconds a cell by method."""
    count, f_max = len(chains["J"]), bands(chains)
    many = {name: np.repeat(values, len(INSIDE), axis=0) for name, values in chains.items()}
    kept, off, seconds = [], [], []
    for name in METHODS:
        cells = count * len(INSIDE)
        swept({k: v[:8] for k, v in many.items()}, ["n_kept"], reduction=name, f_max=f_max.ravel()[:8])  # warm
        start = time.perf_counter()
        ds = swept(many, ["n_kept", "frf_error"], reduction=name, f_max=f_max.ravel())
        seconds.append((time.perf_counter() - start) / cells)
        kept.append(ds.n_kept.values.reshape(count, -1))
        off.append(ds.frf_error.values.reshape(count, -1))
    dims = ("reduction", "drivetrain", "inside")
    return xr.Dataset(
        {"kept": (dims, np.array(kept)), "off": (dims, np.array(off)), "seconds": ("reduction", seconds)},
        coords={"reduction": list(METHODS), "inside": list(INSIDE)},
    )


def statements(ds: xr.Dataset) -> Groups:
    """What each method needs."""
    more = (ds.kept - ds.inside).mean("drivetrain")
    modal = bool((ds.kept.sel(reduction="modal") == ds.inside).all())
    order = [float(more.sel(reduction=name).mean()) for name in METHODS]
    lines = [
        Statement("modal: as many as there are frequencies", "yes", "all cells", None, modal),
        Statement("no method needs fewer", "yes", "all cells", None, bool((ds.kept >= ds.inside).all())),
        Statement("Rivin needs the most, then Guyan, then IRS", "yes", ", ".join(f"+{x:.2f}" for x in order[:3]), None,
                  order[0] > order[1] > order[2]),
    ]  # fmt: skip
    return {f"Masses for {100 * TOLERANCE:g} %": lines}


def notes(ds: xr.Dataset) -> list[str]:
    """Masses needed by method and band, the receptance's error, and time."""
    rows: list[tuple[str, ...]] = [("frequencies in the band", *map(str, INSIDE), "H off by", "us a cell")]
    for name in METHODS:
        cell = ds.sel(reduction=name)
        mean = [f"{float(x):.1f}" for x in cell.kept.mean("drivetrain").values]
        rows.append((name, *mean, f"{float(cell.off.median()):.1e}", f"{1e6 * float(cell.seconds):.0f}"))
    return ["MASSES KEPT, mean of all drivetrains; median error of the spindle's receptance", *columns(rows, "  ")]


def figure(ds: xr.Dataset) -> Any:
    """Median of masses needed over frequencies in the band, with the middle 80 %; and how many beyond them suffice."""
    from sweep import charts
    from sweep.charts import COLOURS, MARKS

    with charts.style():
        page = charts.new_figure(charts.PAGE, 80.0)
        left, right = page.subplots(1, 2)
        for i, name in enumerate(METHODS):
            kept = ds.kept.sel(reduction=name)
            low, mean, high = (kept.quantile(q, "drivetrain").values for q in (0.1, 0.5, 0.9))
            label = name.replace("_", "-")
            left.errorbar(
                ds.inside + 0.08 * (i - 2), mean, (mean - low, high - mean), marker=MARKS[i],
                color=COLOURS[i], label=label, elinewidth=0.6, capsize=1.5,
            )  # fmt: skip
            beyond = (kept - ds.inside).values.ravel()
            share = [np.mean(beyond <= extra) for extra in range(9)]
            right.plot(range(9), share, marker=MARKS[i], color=COLOURS[i], label=label)
        left.axhline(MASSES, color="0.5", linewidth=0.7)
        left.set(xlabel="frequencies in the band", ylabel="masses needed for 1 %", ylim=(0, MASSES + 0.7))
        left.legend(loc="lower right")
        right.set(
            xlabel="masses beyond the frequencies in the band", ylabel="share of drivetrains and bands they suffice"
        )
        right.set(ylim=(0, 1.03), xlim=(-0.2, 8.2))
        for axes, text in ((left, "a"), (right, "b")):
            charts.letter(axes, text)
    return page


def main(arguments: Sequence[str]) -> int:
    """Table and figure; 1 if a statement does not hold."""
    from sweep import charts

    if len(arguments) > 1 or not all(a.isdigit() and int(a) > 0 for a in arguments):
        print("use: python fewest_masses.py [drivetrains]", file=sys.stderr)
        return 2
    ds = needed(drivetrains(int(arguments[0]) if arguments else 400))
    groups = statements(ds)
    print("\n".join([*table(groups, "expected"), "", *notes(ds), ""]))
    print(f"figure: {charts.save(figure(ds), 'fewest_masses.png')}")
    return int(any(s.holds is False for lines in groups.values() for s in lines))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
