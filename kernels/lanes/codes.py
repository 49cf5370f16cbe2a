"""The statuses as numbers that lanes can hold: `where(condition, OK, BAD_INPUT)`; their one home in `kernels/`.

A verdict is a float64 of a cell, or lanes of them, until `write` puts it into the int8 column. The names are those of
`kernels.interface.Status`, where it stands what each means, in its order: OK, remarks, refusals.
"""

from kernels.interface import FIRST_REFUSAL, Status

REFUSED = float(FIRST_REFUSAL)
"""A verdict from here on is a refusal."""


def __getattr__(name: str) -> float:
    """The number of a status: `from kernels.lanes.codes import OK`."""
    if name in Status.__members__:
        return float(Status[name])
    raise AttributeError(f"no status is called {name}")
