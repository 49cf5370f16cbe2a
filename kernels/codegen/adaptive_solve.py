"""Columns of cells of a scene followed by Dormand-Prince 5(4) or DOP853, each twice, as by the Taylor method."""

from types import SimpleNamespace

from kernels.codegen import followed_twice
from kernels.codegen.stepped_source import adaptive

APART = {"dopri5": followed_twice.APART, "dop853": 4.0}
"""How many rtol the two runs may differ by; DOP853's weights of up to 43 make more of rounding than the others do."""

FINEST = 1e-13
"""The tightest tolerance that is tried where a wider one fails: below it rounding stops the steps."""


def twice_by(method, scene):
    """The function of columns (`followed_twice.twice`) that follows the scene by "dopri5" or "dop853"."""

    def twice(module, columns, rtol, outputs, status):
        run = getattr(adaptive(scene), f"run_{method}")
        runs = SimpleNamespace(STATES=module.STATES, ROWS=module.ROWS, run_12=run, run_18=run)
        followed_twice.twice(runs, columns, rtol, outputs, status, APART[method], FINEST)

    return twice
