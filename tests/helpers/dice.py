"""A kernel whose methods do to each cell whatever they may, as if by dice, and the same each time. Named "dice:KERNEL".

What a method gives, promises and says of a cell hangs on the bits of the cell's parameters alone. So every case of
choosing a method comes up in some cells of a small grid, and an interpreter that asks one cell at a time sees the same.
"""

from __future__ import annotations

import numpy as np

from kernels.interface import Field, Kernel, Method, Status

RAISES = 13.0
"""Methods that are not cheap raise at this x."""
before_check = None
"""Called with the x of the cells before they are checked, where it is not None: to count, to stop, to fail."""

SAID = (
    *(Status.OK,) * 5, Status.INACCURATE, Status.GRAZING, *(Status.NO_METHOD, Status.NO_CYCLE) * 2,
    Status.NOT_CONVERGED, Status.STEP_LIMIT, Status.UNSTABLE, Status.PERIOD_2, Status.STICKS, Status.OUT_OF_RANGE,
    Status.PENDING, -3,
)  # fmt: skip
PROMISED = (1e-13, 1e-9, 1e-9, 1e-6, 1e-6, 3e-5, 3e-5, 1e-3, 1e-3, 0.1, np.inf, np.nan)
NUMBERS = (np.nan, np.inf, -0.0, 1e16, -1e16, *np.linspace(-3.0, 9.0, 37))


def thrown(salt, *columns):
    """A whole number for each cell, that of others whatever the cell is among."""
    found = np.full(len(columns[0]), salt, np.uint64)
    for column in columns:
        found = (found ^ np.ascontiguousarray(column, float).view(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        found ^= found >> np.uint64(29)
    return (found * np.uint64(0xBF58476D1CE4E5B9)) >> np.uint64(33)


def taken(choice, salt, *columns):
    return np.array(choice)[thrown(salt, *columns) % np.uint64(len(choice))]


def check(x, y, z, kind, status):
    """BAD_INPUT or OUT_OF_RANGE for some, and rarely what no kernel may say; NaN is bad."""
    if before_check is not None:
        before_check(x)
    status[...] = np.where(x > 0, Status.OK, Status.BAD_INPUT)
    chance = thrown(1, x, y, z, kind) % np.uint64(33)
    status[chance % np.uint64(11) == 0] = Status.OUT_OF_RANGE
    status[chance == 1] = Status.PENDING


def gives(salt, columns, phase, a, b, c, status):
    """Outputs and statuses; hardly ever no number where there has to be one."""
    rare = thrown(salt + 1, *columns) % np.uint64(29)
    a[...] = np.where(rare == 0, np.nan, taken(NUMBERS[2:], salt + 2, *columns))
    b[...] = taken(NUMBERS, salt + 3, *columns)
    c[...] = a[:, None] + phase * taken(NUMBERS[2:], salt + 4, *columns)[:, None]
    c[rare == 1, -1:] = -np.inf
    status[...] = taken(SAID, salt + 5, *columns)


def method(name, salt, *, bound=False, estimates=False, dear=False, **keys):
    """A method and what it is declared to be."""

    def solve(x, y, z, kind, rtol, phase, *rest):
        if dear and (x == RAISES).any():
            raise ZeroDivisionError("thirteen")
        asked, error = (rest[0], rest[-2]) if estimates else (None, None)
        a, b, c = rest[1:4] if estimates else rest[:3]
        gives(salt, (x, y, z, kind), phase, a, b, c, rest[-1])
        if estimates:
            error[...] = taken(PROMISED, salt + 6 + 8 * int(asked @ (1, 2, 4)), x, y, z, kind)

    def bounds(x, y, z, kind, rtol, phase, asked, out):
        out[...] = taken(PROMISED, salt + 7 + 8 * int(asked @ (1, 2, 4)), x, y, z, kind)

    def sooner(x, y, z, kind, rtol):
        return thrown(salt + 8, x, y, z, kind, rtol) % np.uint64(2) == 0

    keys |= {"sooner": sooner} if keys.pop("sooner", False) else {}
    return Method(name, "", solve, bounds if bound else None, estimates=estimates, **keys)


KERNEL = Kernel(
    name="dice",
    doc="Whatever a kernel may do.",
    source="chance",
    parameters=(
        Field("x", "m", "x"),
        Field("y", "m", "y", default=1.0),
        Field("z", "m", "z", default="y"),
        Field("kind", "1", "kind", default=0.0, choices={"plain": 0, "odd": 3}),
    ),
    outputs=(Field("a", "s", "a"), Field("b", "1", "b", gaps=True), Field("c", "m", "c", dims=("phase",))),
    along=(Field("phase", "1", "phase", lower=0, upper=1),),
    check=check,
    methods=(
        method("formula", 1000, bound=True, excludes=("y",)),
        method("brief", 2000, bound=True, lacks=("b",)),
        method("series", 3000, bound=True, excludes=("kind",)),
        method("guess", 4000, estimates=True, dear=True),
        method("swift", 5000, sooner=True, excludes=("z",)),
        method("solid", 6000, dear=True),
        method("loose", 7000, bound=True, dear=True),
    ),
)
