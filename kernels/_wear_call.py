"""Compiler options of the kernels of wear, whose functions are long and many, so that seconds of compiling count."""

import functools

import numpy as np

from kernels._columns import entry
from kernels._jit import COMPILED, jit_call

call = jit_call
"""For every function that is not a line or two: pasted in, they would be compiled over and over."""


def entry_of_cells(*shared):
    """As `entry`, of a function with its own loop: each level between it and the physics would be compiled anew."""

    def decorate(function):
        if COMPILED:
            return entry(*shared)(function)

        @functools.wraps(function)
        def plain(*columns):
            with np.errstate(all="ignore"):
                function(*columns)

        return plain

    return decorate
