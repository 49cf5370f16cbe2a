"""What a family of scenes is: a scene, random cells of it, their truth, and how what a method gives is judged by it.

Truth is a formula in 80-bit numbers, or where there is none a Taylor series of order 24 in such numbers, the errors of
which the families' conditions keep below 1e-9 of the least rtol. A time is off relative to itself, a state relative to
the largest size that it had on the way.
"""

from typing import NamedTuple

import numpy as np

from kernels.interface import Status
from kernels.scene import Field, scene_kernel

REAL = np.longdouble
PI = REAL("3.14159265358979323846264338327950288")


class Truth(NamedTuple):
    """Of cells: time and states at the end, the states' largest sizes, and the condition; the motion's own status."""

    time: np.ndarray
    states: list
    sizes: list
    condition: np.ndarray
    ends: Status = Status.OK


class Family(NamedTuple):
    """A scene, random cells {parameter: column} of it, and their truth."""

    kernel: object
    cells: object
    truth: object


FAMILIES = {}


def family(kernel, truth):
    """Enters a function of random cells by its name."""

    def enter(cells):
        FAMILIES[cells.__name__] = Family(kernel, cells, truth)
        return cells

    return enter


def scene(name, states, parameters, rates, surface, start, switch=None):
    fields = tuple(Field(s, "1", s) for s in states.split())
    return scene_kernel(
        name=f"family_{name}", doc=name, states=fields, parameters=tuple(Field(p, "1", p) for p in parameters.split()),
        rates=rates, surface=surface, start=start, switch=switch,
    )  # fmt: skip


def judged(kernel, truth, outputs, status, rtol):
    """The error of each cell that is OK over its rtol; inf where it should be none."""
    with np.errstate(all="ignore"):
        off = [abs(outputs["time"] - truth.time) / abs(truth.time)]
        for field, value, size in zip(kernel.outputs[2:], truth.states, truth.sizes, strict=True):
            part = abs(outputs[field.name] - value) / size
            part = np.where((value == 0) & (size == 0), 0, part)
            off.append(np.where(np.isnan(value) & ~np.isnan(truth.time), 0, part))
        worst = np.max(np.nan_to_num(np.array(off, float), nan=np.inf), axis=0) / rtol
    return np.where(np.isin(status, (Status.OK, Status.COMES_TO_REST)), worst, 0.0)
