"""Kernels for tests of faults: the stone of `toy`, slow, or failing."""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import signal
import time

import toy

CELL_SECONDS = 0.002


def slow(height, *rest):
    """As `toy.exact`, two milliseconds a cell."""
    time.sleep(CELL_SECONDS * len(height))
    toy.exact(height, *rest)


calls = []
"""Cells of each call of `called`."""


def called(height, *rest):
    """As `toy.exact`; a call takes two milliseconds, however many cells it has."""
    calls.append(len(height))
    time.sleep(CELL_SECONDS)
    toy.exact(height, *rest)


def lethal(height, *rest):
    """As `toy.exact`; the process dies of 13 m, if it is a child of another Python."""
    if (height == 13).any() and multiprocessing.parent_process() is not None:
        os.kill(os.getpid(), signal.SIGKILL)
    toy.exact(height, *rest)


def kernel(solve):
    """The toy kernel with one method."""
    return dataclasses.replace(
        toy.KERNEL, name=solve.__name__, methods=(dataclasses.replace(toy.KERNEL.methods[1], solve=solve),)
    )


SLOW, CALLED, LETHAL = map(kernel, (slow, called, lethal))
