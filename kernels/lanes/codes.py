"""The statuses as float64 for lanes, as in `where(condition, OK, BAD_INPUT)`; defined in `kernels/` only here.

A status is a float64, or lanes of them, until `write` puts it into the int8 column. Names, meanings and order are those
of `kernels.interface.Status`: OK, remarks, refusals.
"""

from kernels.interface import FIRST_REFUSAL, Status

REFUSED = float(FIRST_REFUSAL)
"""A verdict from here on is a refusal."""


def __getattr__(name: str) -> float:
    """The number of a status: `from kernels.lanes.codes import OK`."""
    if name in Status.__members__:
        return float(Status[name])
    raise AttributeError(f"no status is called {name}")
