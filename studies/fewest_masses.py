"""How many masses does a drivetrain need to hold its frequencies to 1 % up to a given band, by each method?

    python studies/fewest_masses.py [drivetrains]

takes the 2000 random drivetrains of ten masses that fewest_masses.csv holds (or as many as told), reduces each by every
method for bands that hold its first 1 to 8 frequencies, prints what they need and what it costs, and draws
fewest_masses.png here. What comes out:

- modal reduction needs as many masses as there are frequencies in the band;
- IRS needs 0.3 more in the mean, Craig-Bampton 0.6 more (one more in a narrow band), Guyan 1.5 more;
- Rivin's chain needs 2.7 more, and nine of the ten where the band holds seven: that is the price of staying a chain;
- with frequencies held to 1 %, Rivin's and Guyan's receptance of the spindle is still 3 to 4 % off, that of the others
  0.02 to 0.15 %: with about 1 % of damping a resonance that moves by 0.4 % is felt;
- no method is cheap or dear: a model of five, compared with the full chain, takes 0.1 to 0.2 ms by each, three to five
  times as long as the full chain of ten alone with its poles; to find the fewest takes 0.2 to 0.3 ms.
"""

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from _common import OPTIONS, Groups, columns, said, shown
from _figures import page_of

import sweep
from kernels.catalogue import KERNELS
from kernels.interface import load
from sweep.show.charts import COLOURS, MARKS

METHODS = ("rivin", "guyan", "irs", "craig_bampton", "modal")
MASSES, SPREAD, DAMPER, TOLERANCE = 10, 100.0, 0.1, 0.01
INSIDE = tuple(range(1, 9))
"""Frequencies that the band holds."""
DRIVETRAINS = 2000
TIMED, TIMED_SIZE, TIMES = 400, 5, 3
"""Cells that are timed, masses of the model for which a number is given, and how often; the least time counts."""


def drivetrains(count: int, seed: int = 1) -> dict[str, np.ndarray]:
    """Random chains: inertias and stiffnesses evenly over the logarithm of a factor SPREAD, in four digits."""
    random = np.random.default_rng(seed)
    J, k = np.moveaxis(SPREAD ** random.uniform(0, 1, (count, 2, MASSES)), 1, 0)
    return {name: np.vectorize(lambda x: float(f"{x:.4g}"))(values) for name, values in (("J", J), ("k", k))}


def swept(chains: dict[str, np.ndarray], outputs: list[str], reduction: str = "none", **more: Any) -> xr.Dataset:
    """One cell a chain; what else differs from cell to cell, or is the same of all, is in `more`."""
    fixed = {"reduction": reduction, "h": DAMPER} | {name: v for name, v in more.items() if np.ndim(v) == 0}
    axes = {name: v.tolist() for name, v in (chains | more).items() if np.ndim(v) > 0}
    return sweep.run(kernel="drivetrain", design="zip", rtol=1e-7, outputs=outputs, axes=axes, fixed=fixed, workers=1)


def bands(chains: dict[str, np.ndarray]) -> np.ndarray:
    """Bands [Hz] that end midway between two frequencies, after INSIDE of them; shape (drivetrains, len(INSIDE))."""
    f = swept(chains, ["frequency"]).frequency.values
    return np.sqrt(f[:, [m - 1 for m in INSIDE]] * f[:, list(INSIDE)])


def timed(chains: dict[str, np.ndarray], **how: Any) -> tuple[float, float]:
    """Processor time of a cell [s], without the engine's; and the median error of the spindle's receptance."""
    kernel = load(KERNELS["drivetrain"])
    count, given = len(chains["J"]), {"h": DAMPER} | chains | how
    values = [np.asarray(given.get(p.name, p.default), float) for p in kernel.parameters]
    shapes = [(count, MASSES) if field.dims else (count,) for field in (*kernel.parameters, *kernel.outputs)]
    inputs = [np.broadcast_to(v, shape).copy() for v, shape in zip(values, shapes, strict=False)]
    outputs = {o.name: np.empty(shape) for o, shape in zip(kernel.outputs, shapes[len(inputs) :], strict=True)}
    asked, error, status = np.ones(len(outputs), np.uint8), np.empty(count), np.empty(count, np.int8)
    least = np.inf
    for _ in range(TIMES + 1):
        start = time.process_time()
        kernel.methods[0].solve(*inputs, np.full(count, 1e-7), asked, *outputs.values(), error, status)
        least = min(least, time.process_time() - start)
    return least / count, float(np.nanmedian(outputs["frf_error"]))


def needed(chains: dict[str, np.ndarray]) -> xr.Dataset:
    """Masses kept and errors over (reduction, drivetrain, inside), and seconds a cell by method."""
    count, f_max = len(chains["J"]), bands(chains)
    many = {name: np.repeat(values, len(INSIDE), axis=0) for name, values in chains.items()}
    dims, inside = ("reduction", "drivetrain", "inside"), np.arange(MASSES) < np.tile(INSIDE, count)[:, None]
    found: dict[str, list[Any]] = {"kept": [], "off": [], "error": []}
    for name in METHODS:
        ds = swept(many, ["n_kept", "frf_error", "frequency_error"], reduction=name, f_max=f_max.ravel(), tol=TOLERANCE)
        worst = abs(ds.frequency_error.where(inside)).max("mode")
        for part, values in zip(found, (ds.n_kept, ds.frf_error, worst), strict=True):
            found[part].append(values.values.reshape(count, -1))
    made = {part: (dims, np.array(values)) for part, values in found.items()}
    return xr.Dataset(made, coords={"reduction": list(METHODS), "inside": list(INSIDE)})


def cost(chains: dict[str, np.ndarray]) -> xr.Dataset:
    """Microseconds a cell and error of its receptance up to the fourth frequency and somewhat beyond, by method.

    `found`: with the fewest masses, and what it takes to find them; `five`: with TIMED_SIZE masses. Both with all that
    is compared: frequencies, poles, receptance. `full`: a chain that stays as it is, with its frequencies and poles.
    """
    few = {name: values[:TIMED] for name, values in chains.items()}
    band = bands(few)[:, 3]
    words = load(KERNELS["drivetrain"]).parameter("reduction").choices
    how = {"found": {"tol": TOLERANCE}, "five": {"n_keep": TIMED_SIZE}}
    spent = np.array([[timed(few, reduction=words[name], f_max=band, **how[way]) for way in how] for name in METHODS])
    dims, coords = ("reduction", "way"), {"reduction": list(METHODS), "way": list(how)}
    made = {"time": (dims, 1e6 * spent[..., 0]), "off": (dims, spent[..., 1]), "full": 1e6 * timed(few)[0]}
    return xr.Dataset(made, coords=coords)


def write_points(path: Path) -> None:
    """The csv file of the toml: DRIVETRAINS chains, each with a band of 1 to 8 of its frequencies in turn."""
    chains = drivetrains(DRIVETRAINS)
    f_max = bands(chains)[np.arange(DRIVETRAINS), np.arange(DRIVETRAINS) % len(INSIDE)]
    names = [f"{name}_{i + 1}" for name in chains for i in range(MASSES)]
    rows = np.hstack([*chains.values(), f_max[:, None]])
    lines = [",".join([*names, "f_max"]), *(",".join(f"{x:.4g}" for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def statements(ds: xr.Dataset) -> Groups:
    """What each method needs."""
    more, worst = (ds.kept - ds.inside).mean("drivetrain"), float(ds.error.max())
    modal, fewer = (ds.kept.sel(reduction="modal") == ds.inside).all(), (ds.kept < ds.inside).any()
    order = [float(more.sel(reduction=name).mean()) for name in METHODS[:3]]
    here, ranked = ", ".join(f"+{x:.2f}" for x in order), order[0] > order[1] > order[2]
    return {
        f"Masses for {100 * TOLERANCE:g} %": [
            said("modal: as many as there are frequencies", modal, "all cells", "yes"),
            said("no method needs fewer", not fewer, "all cells", "yes"),
            said("Rivin needs the most, then Guyan, then IRS", ranked, here, "yes"),
            said("frequencies in the band are held", worst <= TOLERANCE, f"{worst:.4f}", f"{TOLERANCE:g}"),
        ]
    }


def notes(ds: xr.Dataset, times: xr.Dataset) -> list[str]:
    """Masses needed by method and band, the errors that are left, and time."""
    rows: list[tuple[str, ...]] = [("frequencies in the band", *map(str, INSIDE))]
    left: list[tuple[str, ...]] = [("", "frequencies off by", "receptance off by", "us to find it", "us a model of 5")]
    for name in METHODS:
        cell = ds.sel(reduction=name)
        rows.append((name, *(f"{float(x):.1f}" for x in cell.kept.mean("drivetrain").values)))
        errors = (f"{float(cell[part].median()):.1e}" for part in ("error", "off"))
        left.append((name, *errors, *(f"{x:.0f}" for x in times.time.sel(reduction=name).values)))
    return [
        f"MASSES KEPT, mean of {ds.sizes['drivetrain']} drivetrains", *columns(rows, "  "),
        "", "ERRORS LEFT (median) AND COST (processor time of a cell, with all that is compared)", *columns(left, "  "),
        f"the full chain with its poles: {float(times.full):.0f} us",
    ]  # fmt: skip


def figure(ds: xr.Dataset, times: xr.Dataset) -> Any:
    """Median of masses needed with the middle 80 %; how many beyond the frequencies in the band suffice; and cost."""
    names = [name.replace("_", "-") for name in METHODS]
    with page_of(82.0, 1, 3, width_ratios=(1.1, 1.1, 1)) as (page, (left, right, dear)):
        for i, name in enumerate(METHODS):
            kept, look = ds.kept.sel(reduction=name), {"marker": MARKS[i], "color": COLOURS[i]}
            low, mean, high = (kept.quantile(q, "drivetrain").values for q in (0.1, 0.5, 0.9))
            bars = {"label": names[i], "elinewidth": 0.6, "capsize": 1.5}
            left.errorbar(ds.inside + 0.08 * (i - 2), mean, (mean - low, high - mean), **look, **bars)
            beyond = (kept - ds.inside).values.ravel()
            right.plot(range(9), [np.mean(beyond <= extra) for extra in range(9)], label=names[i], **look)
            fewest, five = times.off.values[i]
            dear.plot([five, fewest], [-i, -i], color=COLOURS[i], linewidth=0.8)
            dear.plot(five, -i, fillstyle="none", **look)
            dear.plot(fewest, -i, **look)
        left.axhline(MASSES, color="0.5", linewidth=0.7)
        left.text(0.6, MASSES + 0.15, "the full chain", fontsize=7, color="0.3")
        left.set(xlabel="frequencies in the band [1]", ylabel="masses needed for 1 % [1]", ylim=(0, MASSES + 0.7))
        left.set(xticks=INSIDE)
        right.set(xlabel="masses beyond those frequencies [1]", ylabel="share of cases where they suffice [1]")
        right.set(ylim=(0, 1.03), xlim=(-0.2, 6.2))
        page.legend(*right.get_legend_handles_labels(), loc="outside upper center", ncols=5)
        left.errorbar([], [], [], color="0.3", marker=".", elinewidth=0.6, capsize=1.5, label="median and middle 80 %")
        left.legend(handles=left.get_legend_handles_labels()[0][-1:], loc="lower right", handlelength=1)
        for label, fill in (("fewest for 1 %", "full"), ("five masses", "none")):
            dear.plot([], [], "o", color="0.3", fillstyle=fill, label=label)
        dear.legend(loc="lower right", fontsize=7)
        dear.set(xscale="log", xlabel="median error of receptance [1]", xlim=(3e-5, 3), ylim=(-len(names) - 0.4, 0.6))
        dear.set_yticks(range(0, -len(names), -1), labels=names)
        dear.set_yticks([], minor=True)
    return page


def conclusions(count: int) -> Any:
    """Statements, tables and the figure of so many drivetrains."""
    chains = drivetrains(count)
    ds, times = needed(chains), cost(chains)
    return statements(ds), ["", *notes(ds, times)], lambda: figure(ds, times)


def main(arguments: Sequence[str]) -> int:
    """Table and figure; 1 if a statement does not hold."""
    if list(arguments) == ["points"]:
        write_points(Path(__file__).with_suffix(".csv"))
        return 0
    counts = [argument for argument in arguments if argument not in OPTIONS]
    if len(counts) > 1 or not all(a.isdigit() and int(a) > 0 for a in counts):
        print("use: python fewest_masses.py [drivetrains] [--all] [--force]", file=sys.stderr)
        return 2
    count = int(counts[0]) if counts else DRIVETRAINS
    return shown("fewest_masses", Path("fewest_masses.png"), lambda: conclusions(count), arguments, "expected")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
