"""Functions that are run when code is compiled, on symbols."""

import sys
import threading

import numba
import pytest

from kernels.lanes.jit import COMPILED
from kernels.lanes.symbols import written


@pytest.mark.skipif(not COMPILED, reason="numba's types")
def test_functions_that_threads_make_at_the_same_time_are_not_taken_for_one_another():
    """Another one's would be compiled in its place, in a scene that two threads ask for at once."""
    made, interval = [], sys.getswitchinterval()

    def several():
        for _ in range(300):
            made.append(written(lambda xs: xs[0]))

    threads = [threading.Thread(target=several) for _ in range(3)]
    sys.setswitchinterval(1e-5)
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert all(numba.typeof(function).typing_key is function for function in made)
