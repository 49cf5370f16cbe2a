"""With `auto` each cell is tried by the methods that can do its own terms, whatever it is solved with."""

from dataclasses import replace

import foliot_oracles
import numpy as np
import pytest
from stand_ins import solved, toy_study, with_kernel
from toy import KERNEL

import sweep
from kernels.foliot.cycle import FOLIOT
from kernels.interface import Status
from sweep.cells.grid import Grid
from sweep.cells.turns import Absent, Turn, turns

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


@pytest.mark.parametrize("rtol", [1e-3, 1e-9])
def test_cells_are_the_same_in_any_order_among_more_and_in_strips_of_any_length(whole, rtol, monkeypatch):
    found, cells = whole
    order = np.random.default_rng(3).permutation(len(cells["a"]))
    shuffled = foliot(rtol, design="zip", axes={name: values[order] for name, values in cells.items()})
    assert same(solved(shuffled), rows(found[rtol], order))
    more = solved(foliot(rtol, axes={**TERMS, "R": [0.0, 0.1, 0.2]}))
    kept = np.arange(48).reshape(2, 3, 2, 2, 2)[:, :2].ravel()
    assert same(rows(more, kept), found[rtol])
    for strip in (1, 5, 7):
        monkeypatch.setattr("sweep.cells.solve.STRIP", strip)
        assert same(solved(foliot(rtol)), found[rtol])
        assert same(solved(foliot(rtol), 3, 20), rows(found[rtol], slice(3, 20)))


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


def test_a_method_named_still_refuses_a_study_of_which_it_cannot_do_every_cell():
    axes = {"c": [0.0, 0.3], "e": [1.0, 0.7]}
    with pytest.raises(sweep.StudyError, match="segments cannot do c; use auto, pure, quadrature, taylor or dopri5"):
        foliot(1e-9, axes=axes, method="segments")
    with pytest.raises(sweep.StudyError, match="segments cannot do c; use auto, quadrature, taylor or dopri5"):
        foliot(1e-9, axes={**axes, "a": [0.0, 0.1]}, method="segments")


def toy_of(*, rough=(), sooner=None, v0=0.0, solve=None):
    """The toy kernel whose first method excludes some terms, and whose second is tried sooner somewhere."""
    first = replace(KERNEL.methods[0], excludes=tuple(rough), bound=None)
    second = replace(KERNEL.methods[1], sooner=sooner, solve=solve or KERNEL.methods[1].solve)
    fields = tuple(replace(field, default=v0) if field.name == "v0" else field for field in KERNEL.parameters)
    return replace(KERNEL, parameters=fields, methods=(first, second))


def used(kernel, **keys):
    return solved(with_kernel(toy_study(**keys), kernel))[2].tolist()


def test_a_term_is_absent_where_it_has_its_default_a_number_or_another_parameter():
    axes = {"v0": [0.0, 1.0, 2.0], "height": [1.0, 2.0]}
    keys = {"axes": axes, "fixed": {}}
    assert used(toy_of(), **keys) == [0] * 6
    assert used(toy_of(rough=["v0"]), **keys) == [0, 0, 1, 1, 1, 1]
    assert used(toy_of(rough=["v0"], v0=1.0), **keys) == [1, 1, 0, 0, 1, 1]
    assert used(toy_of(rough=["v0"], v0="height"), **keys) == [1, 1, 0, 1, 1, 0]
    assert used(toy_of(rough=["v0", "height"], v0="g"), **keys) == [1] * 6


def test_a_term_that_is_an_array_is_absent_where_all_of_it_is():
    columns = [np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([[0.0, 0.0], [0.0, 1.0]])]
    assert Absent(0, 0.0, None).holds(columns).tolist() == [True, False]
    assert Absent(0, np.nan, 1).holds(columns).tolist() == [True, True]


def test_what_holds_in_all_cells_or_in_none_is_not_asked_of_each():
    def found(kernel, **keys):
        study = with_kernel(toy_study(**keys), kernel)
        return [(turn.number, len(turn.absent)) for turn in turns(study, Grid(study))]

    kernel = toy_of(rough=["v0"])
    assert found(kernel, axes={"height": [1.0, 2.0]}) == [(0, 0), (1, 0)]
    assert found(kernel, axes={"height": [1.0]}, fixed={"v0": 1.0}) == [(1, 0)]
    assert found(kernel, axes={"v0": [1.0, 2.0]}, fixed={"height": 1.0}) == [(1, 0)]
    assert found(kernel, axes={"v0": [0.0, 2.0]}, fixed={"height": 1.0}) == [(0, 1), (1, 0)]
    assert found(replace(kernel, methods=(replace(kernel.methods[0], lacks=("drop",)), kernel.methods[1])),
                 axes={"height": [1.0]}, outputs=["drop"], along={"phase": [0.0, 1.0]}) == [(1, 0)]  # fmt: skip


def test_in_a_result_begun_so_only_methods_that_can_do_all_cells_take_turns(whole):
    """Cells of which none is special: `taylor` alone can do them all, but for `dopri5`, which comes last."""
    for rtol in (1e-3, 1e-9):
        study = replace(foliot(rtol), by_cell=False)
        assert [turn._replace(number=NAMES[turn.number + 1]) for turn in turns(study, Grid(study))] == [
            Turn("taylor"), Turn("dopri5"),
        ]  # fmt: skip
        assert same(solved(study), solved(replace(foliot(rtol, method="taylor"), by_cell=False)))


def test_a_method_that_is_tried_sooner_is_not_tried_twice():
    seen = []

    def loose(height, v0, g, rtol, phase, fall_time, impact_speed, drop, status):
        seen.extend(height.tolist())
        impact_speed[...], status[...] = 7.0, Status.STEP_LIMIT

    def sooner(height, v0, g, rtol):
        return (height > 1.5) & (rtol > 1e-6)

    keys = {"axes": {"height": [1.0, 2.0, 3.0], "rtol": [1e-3, 1e-9]}}
    assert used(toy_of(sooner=sooner), **keys) == [0, 0, 1, 0, 1, 0]
    assert used(toy_of(sooner=sooner, solve=loose), **keys) == [0] * 6
    assert seen == [2.0, 3.0]
    assert used(toy_of(rough=["height"], sooner=sooner), **keys) == [1] * 6
