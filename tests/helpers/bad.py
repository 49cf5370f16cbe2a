"""Kernels for tests of bad cells: the stone of `toy`, which raises, dies, or never ends, and where."""

from __future__ import annotations

import dataclasses
import os
import signal
import time

import numpy as np
import toy

RAISES, CRASHES, EXITS, HANGS, HOGS, HUNGRY = 11.0, 22.0, 33.0, 44.0, 55.0, 66.0
"""Heights at which the kernel misbehaves."""


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
STUCK = kernel("stuck", HANGS, pause=0.002)
ENDLESS = kernel("endless", HANGS, HOGS)
WORST = kernel("worst", RAISES, CRASHES, EXITS, HANGS, HOGS, HUNGRY)


def nothing_but_bad(height, *rest):
    """Raises at every height."""
    raise ZeroDivisionError(f"at {np.size(height)} cells")


HOPELESS = dataclasses.replace(RAISING, methods=(dataclasses.replace(toy.KERNEL.methods[1], solve=nothing_but_bad),))
