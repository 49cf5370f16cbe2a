"""With `auto` each cell is tried by the methods that can do its own terms, whatever it is solved with."""

import foliot_oracles
import numpy as np
import pytest
from stand_ins import solved

import sweep
from kernels.foliot.cycle import FOLIOT
from kernels.interface import Status
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


def same(one, other):
    """Whether cells have the same bits."""
    values = all(np.array_equal(one[0][name], other[0][name], equal_nan=True) for name in one[0])
    return values and all(np.array_equal(a, b) for a, b in zip(one[1:], other[1:], strict=True))


def rows(found, some):
    outputs, status, used = found
    return {name: column[some] for name, column in outputs.items()}, status[some], used[some]


@pytest.fixture(scope="module")
def whole():
    """What `auto` makes of all sums of terms, and the axes' values in each cell."""
    cells = dict(zip(TERMS, (axis.ravel() for axis in np.meshgrid(*TERMS.values(), indexing="ij")), strict=True))
    return {rtol: solved(foliot(rtol)) for rtol in (1e-3, 1e-9)}, cells


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


@pytest.mark.parametrize("rtol", [1e-3, 1e-9])
def test_a_cell_is_the_same_alone_and_among_all_others(whole, rtol):
    found, cells = whole
    for i in range(len(cells["a"])):
        alone = {name: [values[i]] for name, values in cells.items()}
        fixed = FIXED | {name: values[i] for name, values in cells.items() if name != "a"}
        assert same(solved(foliot(rtol, axes=alone)), rows(found[rtol], [i]))
        assert same(solved(foliot(rtol, axes={"a": alone["a"]}, fixed=fixed)), rows(found[rtol], [i]))


def test_every_method_that_takes_a_part_is_right_to_rtol(whole):
    """One cell of each by the oracle; spring with drag by `taylor`, for its oracle takes minutes."""
    found, cells = whole
    picked = [(1, 0, 0, 0, 0), (1, 1, 0, 0, 0), (0, 0, 1, 0, 0), (1, 1, 0, 1, 1), (1, 1, 1, 0, 0)]
    places = [int("".join(map(str, where)), 2) for where in picked]
    truths = [foliot_oracles.cycle(**FIXED, **{name: v[i] for name, v in cells.items()}) for i in places]
    both = int("11110", 2)
    truths.append([column[both] for column in found[1e-9][0].values()])
    assert {NAMES[found[1e-9][2][i] + 1] for i in (*places, both)} == {
        "closed", "coulomb", "pure", "segments", "quadrature", "taylor",
    }  # fmt: skip
    for rtol, (outputs, status, _) in found.items():
        given = np.transpose([column[[*places, both]] for column in outputs.values()])
        assert (status[[*places, both]] == Status.OK).all()
        assert (np.abs(given / np.array(truths, float) - 1.0) <= rtol).all()
