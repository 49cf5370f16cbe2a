"""With `auto` each cell is tried by the methods that can do its own terms, whatever it is solved with."""

import numpy as np
from stand_ins import solved

import sweep
from kernels.foliot.cycle import FOLIOT
from sweep.cells.grid import Grid

TERMS = {"a": [0.0, 0.1], "R": [0.0, 0.1], "c": [0.0, 0.3], "k": [0.0, 0.1], "e": [1.0, 0.7]}
FIXED = {"mu": 1.0, "phi0": 1.0, "n": 2.0}
NAMES = ["none", *(m.name for m in FOLIOT.methods)]


def foliot(rtol, **keys):
    keys = {"axes": TERMS, "fixed": FIXED, **keys}
    return sweep.study(kernel="foliot", **keys, **({} if rtol is None else {"rtol": rtol}))


def names_of(study):
    """Names of the methods that solve the cells of a grid, in its shape."""
    return np.array(NAMES)[solved(study)[2] + 1].reshape(Grid(study).shape)


def test_each_cell_goes_to_the_cheapest_method_that_can_do_its_terms():
    names = names_of(foliot(1e-9))
    assert names[0, 0, 0, 0].tolist() == ["none", "pure"]  # nothing is lost; restitution alone
    assert names[1, 0, 0, 0].tolist() == ["closed", "segments"]
    assert names[0, 1, 0, 0, 0] == names[0, 0, 1, 0, 0] == "pure"
    assert names[1, 1, 0, 0].tolist() == ["coulomb", "segments"]
    assert (names[:, :, 0, 1].ravel()[1:] == "segments").all()
    assert set(names[:, :, 1, 0].ravel()) == {"pure", "quadrature"}
    assert (names[:, :, 1, 1] == "taylor").all()


def test_which_general_method_comes_first_hangs_on_rtol_and_degree():
    axes = {"rtol": [0.02, 1e-2, 1e-4, 9e-5], "n": [1.0, 2.5, 6.0, 6.1]}
    names = names_of(foliot(None, axes=axes, fixed={"mu": 1.0, "phi0": 1.0, "a": 0.1, "c": 0.3, "k": 0.1}))
    assert (names == "dopri5").tolist() == [[False] * 4, *[[True, True, True, False]] * 2, [False] * 4]
    assert set(names.ravel()) == {"dopri5", "taylor"}
