"""The stone of `toy` as a kernel of night.py: bad at cells that are scattered over any grid, in every way."""

from __future__ import annotations

import time

import bad
import numpy as np
import slow
import toy

from kernels.interface import Status

NIGHT_SECONDS, BAD_SHARE, LEAK_BYTES = 0.002, 400, 4 << 20
DEEDS = ("raises", "crashes", "exits", "hangs", "hogs", "writes NaN", "leaks", "is refused")
FAILING = DEEDS[:6]
BY_DEED = {"raises": bad.RAISES, "crashes": bad.CRASHES, "exits": bad.EXITS, "hangs": bad.HANGS, "hogs": bad.HOGS}
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
    bad.misbehave([BY_DEED[kind] for kind in kinds if kind in BY_DEED], BY_DEED.values())
    _leaked.extend(np.ones(LEAK_BYTES // 8) for kind in kinds if kind == "leaks")
    toy.exact(height, *rest)
    fall_time, status = rest[-4], rest[-1]
    fall_time[[kind == "writes NaN" for kind in kinds]] = np.nan
    status[[kind == "is refused" for kind in kinds]] = Status.STICKS


NIGHT = slow.kernel(night)
