"""The statuses as numbers that lanes can hold: `where(condition, OK, BAD_INPUT)`; their one home in `kernels/`.

A verdict is a float64 of a cell or WIDTH of them until `write` puts it into the int8 column. What each status means
stands in `kernels.interface.Status`, in whose order they are: OK, remarks, refusals.
"""

from kernels.interface import FIRST_REFUSAL, Status

REFUSED = float(FIRST_REFUSAL)
"""A verdict from here on is a refusal."""

OK = float(Status.OK)
INACCURATE = float(Status.INACCURATE)
NOT_SELF_STARTING = float(Status.NOT_SELF_STARTING)
COMES_TO_REST = float(Status.COMES_TO_REST)
GRAZING = float(Status.GRAZING)
OVERDAMPED = float(Status.OVERDAMPED)
TOO_SHORT = float(Status.TOO_SHORT)
NEVER_ENDS = float(Status.NEVER_ENDS)
UNSTABLE = float(Status.UNSTABLE)
PERIOD_2 = float(Status.PERIOD_2)
NOT_PERIODIC = float(Status.NOT_PERIODIC)
TOOTH_JUMPED = float(Status.TOOTH_JUMPED)
LOCK_UP = float(Status.LOCK_UP)
CHANGE_POINT = float(Status.CHANGE_POINT)
DOUBLE_CRANK = float(Status.DOUBLE_CRANK)
DAMPERS_OUT_OF_RANGE = float(Status.DAMPERS_OUT_OF_RANGE)
PARTLY_OUT_OF_RANGE = float(Status.PARTLY_OUT_OF_RANGE)
BAD_INPUT = float(Status.BAD_INPUT)
NEVER_STARTS = float(Status.NEVER_STARTS)
NO_LIMIT_CYCLE = float(Status.NO_LIMIT_CYCLE)
OUT_OF_RANGE = float(Status.OUT_OF_RANGE)
NOT_CONVERGED = float(Status.NOT_CONVERGED)
STEP_LIMIT = float(Status.STEP_LIMIT)
NO_METHOD = float(Status.NO_METHOD)
STICKS = float(Status.STICKS)
NO_CYCLE = float(Status.NO_CYCLE)
NEVER_MEETS = float(Status.NEVER_MEETS)
NO_ASSEMBLY = float(Status.NO_ASSEMBLY)
