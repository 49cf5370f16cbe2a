"""What Baran & Marchelek (1971) print of the Fu-la milling machine's drive, and what becomes of each number.

J in 1e-3 kgf m s^2, e in 1e-3 rad/(kgf m), k in kgf m/rad, h in kgf m s/rad, J e in 1e-6 s^2. A number whose last digit
is a 0 is text. Only what can be read in the scan is here.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from _common import Claims, Statement

KGF = 9.80665
Printed = float | str
PARTIAL: dict[int, dict[str, dict[int, Printed]]] = {
    8: {
        "e": {1: 0.133, 2: 0.264, 3: 1.192, 4: 0.726, 5: 0.25, 6: 0.358, 7: 0.19, 8: 0.84},
        "J of b": {1: 1.2, 5: 1.18, 6: 6.07, 7: 50.2},
        "e of a": {2: 0.0885, 3: 0.215, 5: 0.186, 6: 0.148, 7: 0.124, 8: 0.16},
        "J e of a": {2: 0.11, 3: 0.061, 5: 0.27, 6: 0.96, 7: 11.9, 8: 15.9},
        "J e of b": {1: 0.16, 2: 0.06, 7: 9.55},
    },
    7: {
        "e": {2: 1.454, 3: 0.726},
        "J of b": {2: 0.53, 3: 0.52, 4: 1.18, 5: 6.07, 6: 50.2},
        "e of a": {2: 0.122, 4: 0.186, 5: 0.148},
        "J e of a": {2: 0.18, 4: 0.27, 5: 0.96, 6: 11.9, 7: 15.9},
        "J e of b": {2: 0.77, 3: 0.37, 5: 2.17, 6: 9.55},
    },
    6: {
        "e": {1: 1.587, 2: 0.726},
        "J of b": {1: 0.915, 3: 1.18, 5: 50.2},
        "J e of a": {2: 0.47, 3: 0.27, 4: 0.96, 5: 11.9, 6: 15.9},
        "J e of b": {1: 1.45, 3: 0.295, 4: 2.17, 5: 9.55},
    },
}
"""Tables 2 to 4 by number of masses: flexibilities, and partial systems a (a mass, springs held) and b (two masses)."""
SLIPS = (50.2, 9.55, 0.148, 0.96, 15.9)
"""Numbers of tables 2 to 4 that do not follow from its own data, carried through all three; 0.96 is 6.5 times 0.148 and
15.9 is 99.4 times 0.16."""
CHAINS: dict[int, tuple[str, dict[str, list[Printed]]]] = {
    7: ("Table 3", {"J": [25.7, 1.483, 0.82, 1.45, 6.50, 96.0, "99.40"],
                    "h": [0.18, 0.014, 0.037, 0.0975, 0.187, 0.72, 13]}),
    6: ("Table 4", {"J": [27.06, 0.943, 1.45, 6.50, 96.0, "99.40"], "h": [0.013, 0.037, 0.0975, 0.187, 0.72, 13]}),
    5: ("Table 5", {"J": [27.06, 1.314, 7.58, 96.0, "99.40"], "k": [630, 1020, 2800, 5250, 1192],
                    "h": [0.013, 0.0266, 0.187, 0.72, 13]}),
}  # fmt: skip
"""Reduced chains as printed."""
CARRIED = {"Table 5, h2": "slip", "Table 3, J e of b, 3": "misprinted"}
"""h2: from e* = 0.98 instead of 0.9782 in (34), squared: 0.02665. The third digit of 0.37 cannot be read; 0.52 times
0.726 is 0.378, and all digits give 0.382."""
TABLE_6 = {8: [10.6, 19.8, 53.2, 102.6, 227.2, 346.6], 5: [10.6, 19.7, 53.2, 102.6, 187.2, 387.6]}
NEAR = 0.005
"""Largest deviation of a number that two or three digits carried along explain: half of the last of three digits."""


def verdict(text: Printed, here: float) -> str:
    """`reproduced` within half a unit of the last digit, `near` within `NEAR`, else `slip` up to 3 %, `misprinted`."""
    digits, printed = str(text), float(text)
    unit = 10.0 ** -(len(digits.split(".")[1]) if "." in digits else 0)
    if abs(here - printed) <= 0.5 * unit * (1 + 1e-9):
        return "reproduced"
    off = abs(here / printed - 1)
    return "near" if off <= NEAR else "slip" if off <= 0.03 else "misprinted"


def judged(what: str, printed: Printed, here: float, expected: Sequence[str] = ("reproduced", "near")) -> Statement:
    """One printed number; it holds if its verdict is an expected one."""
    word = verdict(printed, here)
    return Statement(what, f"{printed}", f"{here:.5g}  {word}", here / float(printed) - 1, word in expected)


def in_source_units(chain: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """J, k and h of a chain in SI units, in those of the source."""
    return {"J": 1e3 / KGF * chain["J"], "k": chain["k"] / KGF, "h": chain["h"] / KGF}


def tables(chains: Mapping[int, Mapping[str, np.ndarray]]) -> Claims:
    """Every number that can be read, beside the partial systems of each chain by (26), (27), masses counted from 1."""
    yield "Tables 2 to 4"
    for n, rows in PARTIAL.items():
        J, k = chains[n]["J"], chains[n]["k"]
        e = 1e3 / k
        a = {j + 1: e[j - 1] * e[j] / (e[j - 1] + e[j]) for j in range(1, n)}
        b = {j + 1: J[j] * J[j + 1] / (J[j] + J[j + 1]) for j in range(n - 1)}
        here = {"e": dict(enumerate(e, 1)), "J of b": b, "e of a": a}
        here["J e of a"] = {j: J[j - 1] * x for j, x in a.items()}
        here["J e of b"] = {j: x * e[j - 1] for j, x in b.items()}
        for row, values in rows.items():
            for j, printed in values.items():
                what = f"Table {10 - n}, {row}, {j}"
                expected = ("slip",) if printed in SLIPS else ("reproduced", "near")
                expected = (CARRIED[what],) if what in CARRIED else expected
                yield judged(what, printed, here[row][j], expected)

    yield "Tables 3 to 5"
    for n, (table, rows) in CHAINS.items():
        for name, values in rows.items():
            for i, printed in enumerate(values):
                what = f"{table}, {name}{i + 1}"
                expected = (CARRIED[what],) if what in CARRIED else ("reproduced", "near")
                yield judged(what, printed, chains[n][name][i], expected)
