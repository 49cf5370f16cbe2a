"""Is the milling machine's drive of five masses as good as that of eight, and what makes it worse above 1000 rad/s?

    sweep run studies/fula_milling_machine.toml
    python studies/fula_milling_machine.py fula_milling_machine.h5

Rebuilds tables 2 to 6 and figures 6 to 11 of Baran & Marchelek (1971), draws fula_milling_machine.png and says of every
printed number whether it is reproduced, rounded, carried from a slip or misprinted, and of each of its four conclusions
whether it holds. Conclusions:

- Rivin's five masses hold the first four frequencies to 0.2 % and put the fifth 17.5 % low; the source prints that.
- "387.6" in the row of five masses is the seventh frequency of the EIGHT: five masses have no sixth.
- The source's first conclusion names the wrong cause. With the dampers kept exactly, K = k + i w h, nothing changes;
  with mu = 1 - (w/w0)^2 kept, the error vanishes. What is neglected is the inertia of what was taken out.
- At the same size Guyan is 8 times, IRS 50 times, Craig-Bampton 1400 times better at the fifth frequency.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, read_result, report

KGF = 9.80665
METHODS = ("rivin", "guyan", "irs", "craig_bampton", "modal", "exact")
PRINTED = {
    7: ("Table 3", {"J": [25.7, 1.483, 0.82, 1.45, 6.50, 96.0, "99.40"],
                    "h": [0.18, 0.014, 0.037, 0.0975, 0.187, 0.72, 13]}),
    6: ("Table 4", {"J": [27.06, 0.943, 1.45, 6.50, 96.0, "99.40"], "h": [0.013, 0.037, 0.0975, 0.187, 0.72, 13]}),
    5: ("Table 5", {"J": [27.06, 1.314, 7.58, 96.0, "99.40"], "k": [630, 1020, 2800, 5250, 1192],
                    "h": [0.013, 0.0266, 0.187, 0.72, 13]}),
}  # fmt: skip
"""Reduced chains as printed; J in 1e-3 kgf m s^2, k in kgf m/rad, h in kgf m s/rad."""
TABLE_6 = {8: [10.6, 19.8, 53.2, 102.6, 227.2, 346.6], 5: [10.6, 19.7, 53.2, 102.6, 187.2, 387.6]}
NEAR = 0.025
NOTES = """\
reproduced: within half a unit of the last digit printed; rounded: within 2.5 %, from the two or three digits that the
source carries along; misprinted: neither. J8 is 99.44 in Table 1 and 99.40 in all others."""


def verdict(text: float | str, here: float) -> str:
    """What a printed number is; as text where its last digit is a 0."""
    digits, printed = str(text), float(text)
    unit = 10.0 ** -(len(digits.split(".")[1]) if "." in digits else 0)
    if abs(here - printed) <= 0.5 * unit * (1 + 1e-9):
        return "reproduced"
    return "rounded" if abs(here / printed - 1) <= NEAR else "misprinted"


def judged(
    what: str, printed: float | str, here: float, expected: tuple[str, ...] = ("reproduced", "rounded")
) -> Statement:
    """One printed number; it holds if its verdict is an expected one."""
    word = verdict(printed, here)
    return Statement(what, f"{printed}", f"{here:.5g}  {word}", here / float(printed) - 1, word in expected)


def chain(ds: xr.Dataset, n: int) -> dict[str, np.ndarray]:
    """Rivin's chain of n masses in the units of the source."""
    cell = ds.sel(n_keep=n).isel(reduction=0)
    scale = {"J": 1e3 / KGF, "k": 1 / KGF, "h": 1 / KGF}
    return {name: cell[f"{name}_kept"].values[:n] * unit for name, unit in scale.items()}


def tables(ds: xr.Dataset) -> list[Statement]:
    """Tables 3 to 5."""
    lines = []
    for n, (table, rows) in PRINTED.items():
        here = chain(ds, n)
        for name, values in rows.items():
            lines += [judged(f"{table}, {name}{i + 1}", x, here[name][i]) for i, x in enumerate(values)]
    return lines


def frequencies(ds: xr.Dataset) -> list[Statement]:
    """Table 6, with what does not belong there."""
    lines = []
    for n, printed in TABLE_6.items():
        f = ds.frequency.sel(n_keep=n).isel(reduction=0).values
        lines += [judged(f"Table 6, {n} masses, f{i + 1} [Hz]", x, f[i]) for i, x in enumerate(printed[:n])]
    eight = ds.frequency.sel(n_keep=8).isel(reduction=0).values
    word = verdict(387.6, eight[6])
    lines.append(
        Statement('  "f6" of 5 masses: f7 of the 8', "387.6", f"{eight[6]:.5g}  misprinted", eight[6] / 387.6 - 1,
                  word == "rounded")
    )  # fmt: skip
    fifth = float(ds.frequency_error.sel(n_keep=5).isel(reduction=0)[4])
    lines.append(Statement("f5 of 5 masses is low", "", f"{100 * fifth:.2f} %", None, abs(fifth + 0.1745) < 2e-4))
    return lines


def receptance(J: Any, K: Any, w: float) -> complex:
    """Of the spindle, from complex stiffnesses."""
    below = K[-1] - w * w * J[-1]
    for j in range(len(J) - 2, -1, -1):
        below = K[j] * below / (K[j] + below) - w * w * J[j]
    return complex(1 / below)


def removed(J: list[complex], K: list[complex], j: int, w: float, keep_mu: bool) -> tuple[list[complex], list[complex]]:
    """Type a at mass j with complex stiffnesses, (18)-(20); with mu, without error."""
    total = K[j - 1] + K[j] - (w * w * J[j] if keep_mu else 0.0)
    J, K = list(J), list(K)
    left, right, between = J[j] * K[j - 1] / total, J[j] * K[j] / total, K[j - 1] * K[j] / total
    J[j - 1] += left
    J[j + 1] += right
    del J[j], K[j]
    K[j - 1] = between
    return J, K


def source_chain(ds: xr.Dataset) -> dict[str, np.ndarray]:
    """The chain of eight, in SI units."""
    cell = ds.sel(n_keep=8).isel(reduction=0)
    return {name: cell[f"{name}_kept"].values for name in "Jkh"}


def error_at(ds: xr.Dataset, f: float, how: str) -> float:
    """abs(H5/H8 - 1) with the real formulas, with complex ones, or with mu."""
    full, w = source_chain(ds), 2 * math.pi * f
    K = full["k"] + 1j * w * full["h"]
    true = receptance(full["J"], K, w)
    if how == "real":
        small = {name: ds[f"{name}_kept"].sel(n_keep=5).isel(reduction=0).values[:5] for name in "Jkh"}
        return abs(receptance(small["J"], small["k"] + 1j * w * small["h"], w) / true - 1)
    J, K = list(full["J"].astype(complex)), list(K)
    for j in (2, 1, 2):  # J3, J2, J5 of what is left
        J, K = removed(J, K, j, w, how == "mu")
    return abs(receptance(J, K, w) / true - 1)


def cause(ds: xr.Dataset) -> list[Statement]:
    """Which neglect makes the five masses wrong."""
    lines = []
    for f in (187.3, 200.0, 226.9):
        real, exact_dampers, mu = (error_at(ds, f, how) for how in ("real", "complex", "mu"))
        lines.append(
            Statement(f"error at {f:g} Hz: dampers exact", "would vanish", f"{real:.4f} -> {exact_dampers:.4f}", None,
                      abs(exact_dampers / real - 1) < 0.03)
        )  # fmt: skip
        lines.append(Statement("  with mu = 1 - (w/w0)^2", "", f"{mu:.0e}", None, mu < 1e-12))
    worst = max(error_at(ds, f, "real") for f in np.linspace(0.5, 1000 / (2 * math.pi), 2000))
    lines.append(Statement("largest error below 1000 rad/s", "good", f"{100 * worst:.1f} %", None, 0.03 < worst < 0.05))
    return lines


def others(ds: xr.Dataset) -> list[Statement]:
    """Five modes by every method."""
    lines = []
    for code, name in enumerate(METHODS):
        cell = ds.sel(n_keep=5).isel(reduction=code)
        off = 100 * abs(cell.frequency_error.values[:5])
        lines.append(
            Statement(f"{name}: largest error of f1-f4, of f5", "", f"{off[:4].max():.2g} %, {off[4]:.2g} %; "
                      f"receptance {float(cell.frf_error):.1e}")
        )  # fmt: skip
    error = abs(ds.frequency_error.sel(n_keep=5).values[:, 4])
    better = bool(error[0] > error[1] > error[2] > error[3] > error[4])
    lines.append(Statement("each method better at f5 than the one before", "", "", None, better))
    return lines


def figure(ds: xr.Dataset) -> Any:
    """Receptance of the spindle by eight and by five, its error, and errors of frequencies by size."""
    from sweep.show import charts
    from sweep.show.charts import COLOURS, MARKS

    full = source_chain(ds)
    small = {name: ds[f"{name}_kept"].sel(n_keep=5).isel(reduction=0).values[:5] for name in "Jkh"}
    f = np.concatenate([np.linspace(0.2, 60, 600), np.linspace(60, 500, 1400)])
    eight, five = (
        np.array([receptance(c["J"], c["k"] + 2j * math.pi * x * c["h"], 2 * math.pi * x) for x in f]) * KGF * 1e3
        for c in (full, small)
    )
    with charts.style():
        page = charts.new_figure(charts.PAGE, 120.0)
        (polar, amplitude), (error, size) = page.subplots(2, 2)
        for H, name, line in ((eight, "8 masses", "-"), (five, "5 masses", "--")):
            colour = COLOURS[0 if line == "-" else 1]
            polar.plot(H.real, H.imag, line, color=colour, label=name)
            amplitude.semilogy(f, abs(H), line, color=colour, label=name)
        polar.set(xlabel="Re $H$ [10$^{-3}$ rad/(kgf m)]", ylabel="Im $H$")
        polar.set_aspect("equal", "datalim")
        polar.legend(loc="upper left")
        amplitude.set(xlabel="frequency [Hz]", ylabel="$|H|$ [10$^{-3}$ rad/(kgf m)]", xlim=(0, 500))
        draw_errors(error, ds, f[::4])
        for code, name in enumerate(METHODS[:4]):
            worst = abs(ds.frequency_error.isel(reduction=code, mode=slice(0, 4))).max("mode", skipna=False)
            shown = worst.where((worst > 1e-15) & (ds.n_keep < 8))
            size.semilogy(ds.n_keep, shown, MARKS[code] + "-", color=COLOURS[code], label=name.replace("_", "-"))
        size.axhline(0.01, color="0.5", linewidth=0.7)
        size.set(
            xlabel="masses kept",
            ylabel="largest error of $f_1$ to $f_4$",
            xlim=(3.7, 7.3),
            ylim=(1e-9, 1),
            xticks=range(4, 8),
        )
        size.legend(loc="lower left")
        for axes, text in ((polar, "a"), (amplitude, "b"), (error, "c"), (size, "d")):
            charts.letter(axes, text)
    return page


def draw_errors(axes: Any, ds: xr.Dataset, f: np.ndarray) -> None:
    """abs(H5/H8 - 1): with the source's formulas, and with exact dampers."""
    from sweep.show.charts import COLOURS

    for how, name, colour, line in (("real", "source", COLOURS[1], "-"), ("complex", "dampers exact", "black", ":")):
        axes.semilogy(f, [error_at(ds, x, how) for x in f], line, color=colour, label=name)
    axes.axvline(1000 / (2 * math.pi), color="0.5", linewidth=0.7)
    axes.set(xlabel="frequency [Hz]", ylabel="$|H_5/H_8 - 1|$", xlim=(0, 500), ylim=(1e-4, 3))
    axes.legend(loc="lower right")


def read(path: str) -> xr.Dataset:
    """The sweep. Raises SweepError where it is none of this study."""
    return read_result(path, "drivetrain", ["reduction", "n_keep"], "fula_milling_machine.toml")


def conclude(path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = read(path)
    groups = {
        "Tables 3 to 5": tables(ds), "Table 6": frequencies(ds), "The cause": cause(ds),
        "Five by other methods": others(ds),
    }  # fmt: skip
    return groups, [NOTES], figure(ds)


def main(arguments: Sequence[str]) -> int:
    """Table and figure of the result that is named; 1 if a statement does not hold."""
    return report(__file__, ["fula_milling_machine.h5"], arguments, conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
