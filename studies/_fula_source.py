"""What Baran & Marchelek (1971) print of the Fu-la milling machine's drive, and what becomes of each number.

`fula_milling_machine.csv` has what can be read in the scan of tables 2 to 6, in the source's units: J in
1e-3 kgf m s^2, e in 1e-3 rad/(kgf m), k in kgf m/rad, h in kgf m s/rad, J e in 1e-6 s^2, f in Hz; of chains, and of
their partial systems a (a mass, springs held) and b (two masses); and where a number is expected to be wrong, as what.
"""

import csv
import math
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path

import numpy as np
from _common import Claims, Statement

KGF = 9.80665
NEAR, SLIP = 0.005, 0.03
"""Largest deviation of a number that two or three digits carried along explain, which is half of the last of three
digits; and of one that follows from a slip."""


def judged(what: str, text: str, here: float, expected: str = "") -> Statement:
    """One printed number; it holds if its deviation is one of the expected kind, by default the first or second."""
    printed = float(text)
    off, last = here / printed - 1, 0.5 * 10.0 ** -len(text.partition(".")[2]) / printed * (1 + 1e-9)
    bounds = {"reproduced": last, "near": max(last, NEAR), "slip": SLIP, "misprinted": math.inf}
    names, word = list(bounds), next((name for name, bound in bounds.items() if abs(off) <= bound), "none")
    low = bounds[names[names.index(expected) - 1]] if expected else 0.0
    high = bounds[expected or "near"]
    allowed = f"{low:.2g} to {high:.2g} of it"
    return Statement(what, text, f"{here:.5g}  {word}", off, low <= abs(off) <= high, allowed=allowed)


def quantities(chain: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Of a chain in SI units what the source prints, by (26) and (27); there is no system a of the first mass."""
    J, k = 1e3 / KGF * chain["J"], chain["k"] / KGF
    e = 1e3 / k
    a, b = (np.append(np.nan, e[:-1] * e[1:] / (e[:-1] + e[1:])), J[:-1] * J[1:] / (J[:-1] + J[1:]))
    own = {"J": J, "k": k, "h": chain["h"] / KGF, "f": chain["f"], "e": e}
    return own | {"e of a": a, "J of b": b, "J e of a": J * a, "J e of b": b * e[:-1]}


def tables(chains: Mapping[int, Mapping[str, np.ndarray]]) -> Claims:
    """Every number that can be read, by its table, beside that of the chain of so many masses."""
    with Path(__file__).with_name("fula_milling_machine.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    here = {str(n): quantities(chain) for n, chain in chains.items()}
    for table, printed in groupby(rows, lambda row: row["table"]):
        yield table
        for row in printed:
            value = here[row["masses"]][row["quantity"]][int(row["place"]) - 1]
            what = f"{row['masses']} masses, {row['quantity']}, {row['place']}"
            yield judged(what, row["printed"], value, row["expected"])
