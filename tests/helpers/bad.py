"""Kernels for tests of bad cells: the stone of `toy`, which raises, dies, or never ends, and where."""

from __future__ import annotations

import dataclasses
import os
import signal
import sys
import time

import numba
import numpy as np
import toy

from kernels.interface import Status

RAISES, CRASHES, EXITS, HANGS, HOGS, HUNGRY, ORPHANS, QUITS, MUMBLES = (11.0 * k for k in range(1, 10))
"""Heights at which the kernel misbehaves."""


class Mumbling(Exception):
    """Cannot say what it is."""

    def __str__(self):
        raise ValueError("no words")


def spin():
    """Never ends, and lets no other thread of Python run."""
    from ctypes import PyDLL

    PyDLL(None).sleep(1 << 20)


def misbehave(height, kinds):
    """What happens at the first of the heights at which something does."""
    deeds = {
        RAISES: lambda: (_ for _ in ()).throw(ZeroDivisionError("eleven")),
        CRASHES: lambda: os.kill(os.getpid(), signal.SIGSEGV),
        EXITS: lambda: os._exit(7),
        HANGS: lambda: time.sleep(1 << 20),
        HOGS: spin,
        HUNGRY: lambda: (_ for _ in ()).throw(MemoryError()),
        QUITS: lambda: sys.exit(0),
        MUMBLES: lambda: (_ for _ in ()).throw(Mumbling()),
        ORPHANS: lambda: (os.kill(os.getppid(), signal.SIGKILL), time.sleep(60)),
    }
    for one in height:
        if one in kinds:
            deeds[float(one)]()


def kernel(name, *kinds, pause=0.0):
    """The toy kernel with one method, bad at some heights; `pause`: seconds a cell."""

    def solve(height, *rest):
        time.sleep(pause * len(height))
        misbehave(height, kinds)
        toy.exact(height, *rest)

    method = dataclasses.replace(toy.KERNEL.methods[1], solve=solve)
    return dataclasses.replace(toy.KERNEL, name=name, methods=(method,))


RAISING = kernel("raising", RAISES)
DYING = kernel("dying", RAISES, CRASHES, EXITS)
SLOW = kernel("slow", pause=0.05)
QUITTING = kernel("quitting", QUITS, MUMBLES)
ORPHANED = kernel("orphaned", ORPHANS, pause=0.01)
DEADLY = kernel("deadly", CRASHES, EXITS, pause=0.01)
STUCK = kernel("stuck", HANGS, pause=0.002)
ENDLESS = kernel("endless", HANGS, HOGS)
HOGGING = kernel("hogging", HOGS)
WORST = kernel("worst", RAISES, CRASHES, EXITS, HANGS, HOGS, HUNGRY)


def says(height, *rest):
    """Its heights as statuses, modulo 256, whether they are any or not."""
    toy.exact(height, *rest)
    rest[-1][:] = height.astype(np.uint8).view(np.int8)


SAYING = dataclasses.replace(RAISING, methods=(dataclasses.replace(toy.KERNEL.methods[1], solve=says),))


@numba.njit
def _slowly_compiled(x):
    """Takes longer to compile than cells are given in the test."""
    return np.median(x)


def late(height, *rest):
    """As `toy.exact`, what is compiled at the first cell."""
    _slowly_compiled(height)
    toy.exact(height, *rest)


LATE = dataclasses.replace(RAISING, methods=(dataclasses.replace(toy.KERNEL.methods[1], solve=late),))


def whole_only(height, *rest):
    """Crashes at heights that are no whole numbers."""
    misbehave([CRASHES] * int((height % 1 != 0).any()), [CRASHES])
    toy.exact(height, *rest)


WHOLE = dataclasses.replace(RAISING, methods=(dataclasses.replace(toy.KERNEL.methods[1], solve=whole_only),))


def nothing_but_bad(height, *rest):
    """Raises at every height."""
    raise ZeroDivisionError(f"at {np.size(height)} cells")


HOPELESS = dataclasses.replace(RAISING, methods=(dataclasses.replace(toy.KERNEL.methods[1], solve=nothing_but_bad),))


NIGHT_SECONDS, BAD_SHARE, LEAK_BYTES = 0.002, 400, 4 << 20
DEEDS = ("raises", "crashes", "exits", "hangs", "hogs", "writes NaN", "leaks", "is refused")
FAILING = DEEDS[:6]
_leaked = []


def deed(height):
    """What becomes of a cell: one in `BAD_SHARE` of each kind, anywhere; "" of all others."""
    number = int(height) * 0x9E3779B97F4A7C15 % 2**64 >> 40
    kind = number % BAD_SHARE
    return DEEDS[kind] if kind < len(DEEDS) else ""


def night(height, *rest):
    """As `toy.exact`, but for the cells of `deed`."""
    kinds = [deed(one) for one in height]
    time.sleep(NIGHT_SECONDS * len(height))
    misbehave([BY_DEED[kind] for kind in kinds if kind in BY_DEED], BY_DEED.values())
    _leaked.extend(np.ones(LEAK_BYTES // 8) for kind in kinds if kind == "leaks")
    toy.exact(height, *rest)
    fall_time, status = rest[-4], rest[-1]
    fall_time[[kind == "writes NaN" for kind in kinds]] = np.nan
    status[[kind == "is refused" for kind in kinds]] = Status.STICKS


BY_DEED = {"raises": RAISES, "crashes": CRASHES, "exits": EXITS, "hangs": HANGS, "hogs": HOGS}
NIGHT = dataclasses.replace(
    toy.KERNEL, name="night", methods=(dataclasses.replace(toy.KERNEL.methods[1], solve=night),)
)
