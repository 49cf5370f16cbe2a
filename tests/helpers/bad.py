"""Kernels for tests of bad cells: the stone of `toy`, which raises, dies, or never ends, and where."""

from __future__ import annotations

import dataclasses
import os
import signal
import sys
import time

import numba
import numpy as np
import slow
import toy
from numba.extending import overload

RAISES, CRASHES, EXITS, HANGS, HOGS, HUNGRY, ORPHANS, QUITS, MUMBLES = (11.0 * k for k in range(1, 10))
"""Heights at which the kernel misbehaves."""


class Mumbling(BaseException):
    """Cannot say what it is, and is no `Exception`."""

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
        QUITS: lambda: sys.exit("\x1b[31m" + 1000 * "words "),
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

    return dataclasses.replace(slow.kernel(solve), name=name)


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


def _slowly_compiled(x):
    """Takes longer to compile than cells are given in the test."""


@overload(_slowly_compiled)
def _(x):
    time.sleep(1.0)
    return lambda x: None


_compiled = numba.njit(lambda x: _slowly_compiled(x))


def late(height, *rest):
    """As `toy.exact`, what is compiled at the first cell."""
    _compiled(height)
    toy.exact(height, *rest)


def nothing_but_bad(height, *rest):
    """Raises at every height."""
    raise ZeroDivisionError(f"at {np.size(height)} cells")


SAYING, LATE, HOPELESS = map(slow.kernel, (says, late, nothing_but_bad))
