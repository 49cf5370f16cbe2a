"""Compiler options of the kernels of wear, whose functions are long and many, so that seconds of compiling count."""

import functools

import numpy as np
from numba import njit

from kernels._columns import entry
from kernels._jit import _OPTIONS, COMPILED


def call(function):
    """As `jit_call`, for what is never called from Python: without the code for that, a third less to compile."""
    return njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS)(function)


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
