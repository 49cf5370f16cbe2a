"""What is said of cells, and which are left out; which method each gets, the interpreter of `test_engine.py` says."""

import doctest

import pytest
from toy_studies import build

import sweep
from sweep.cells import solve
from sweep.cells.sample import sampled


def test_the_worked_example_comes_out_as_it_stands_there():
    found = doctest.testmod(solve)
    assert found.attempted
    assert not found.failed


AXES = {"height": [-1.0, 1.0, 2.0, 4.0], "v0": [0.0, 1.0, 3.0]}


def test_a_condition_that_holds_nowhere_is_told_before_anything_is_run(tmp_path):
    study = build(axes=AXES, where="height > 4")
    for function, *path in ((sweep.run,), (sweep.run, tmp_path / "a.h5"), (sweep.plan,)):
        with pytest.raises(sweep.SweepError, match='where = "height > 4": holds for none of the 12 cells'):
            function(study, *path)
    assert not list(tmp_path.iterdir())


def test_a_sample_is_of_cells_that_are_asked_for_where_there_are_any():
    axes = {"height": [float(h) for h in range(1, 1001)], "v0": [0.0, 1.0]}
    found = sampled(build(axes=axes, where="height > 990 and v0 > 0.5"), 7).axes
    assert (found["height"].values > 990).all()
    assert found["v0"].values.tolist() == [1.0] * 7
    assert len(sampled(build(axes=axes, where="height < 0"), 7).axes["height"]) == 7
