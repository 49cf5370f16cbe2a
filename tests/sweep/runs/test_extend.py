"""A finished result grows by the new cells only, and ends as one run would have made it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import toy_studies
from hypothesis import given, settings
from hypothesis import strategies as st
from running import kept as kept_blocks
from running import quiet, same

import sweep
from kernels.interface import Status
from sweep.cells.solve import Solver, _Strip
from sweep.cli import main
from sweep.runs import extend as extending
from sweep.system.errors import SweepError

HEIGHTS = np.round(np.linspace(-1.0, 9.0, 21), 3)
SPEEDS = np.array([0.0, 0.5, 3.0, np.nan, 1e4])


def study(heights=HEIGHTS, speeds=SPEEDS, **keys):
    keys = {"outputs": ["fall_time", "drop"], "along": {"phase": [0.0, 0.5, 1.0]}, **keys}
    return toy_studies.build(axes={"height": heights, "v0": speeds}, **keys)


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


@pytest.fixture
def solved(monkeypatch):
    """The cells that methods were asked for, apart from those of samples."""
    counts = []
    real, sampling = _Strip.run, []

    def run(self, number, cells, *bound):
        if not sampling:
            counts.append(len(self.status[cells]))
        return real(self, number, cells, *bound)

    from sweep.cells import block

    take = block.take_sample
    warm = block.warm

    def quietly(action):
        def acting(*rest):
            sampling.append(1)
            try:
                return action(*rest)
            finally:
                sampling.pop()

        return acting

    monkeypatch.setattr(block, "take_sample", quietly(take))
    monkeypatch.setattr(block, "warm", quietly(warm))
    monkeypatch.setattr(_Strip, "run", run)
    return counts


chosen = st.tuples(
    st.sets(st.integers(0, 20), min_size=1, max_size=20), st.sets(st.integers(0, 4), min_size=1, max_size=5)
)


@settings(max_examples=10, deadline=None)
@given(rows=chosen, cells=st.integers(3, 110), before=st.integers(3, 110))
def test_an_extended_result_is_bit_for_bit_that_of_one_run(tmp_path_factory, rows, cells, before):
    output = tmp_path_factory.mktemp("run") / "out.h5"
    few = study(HEIGHTS[sorted(rows[0])], SPEEDS[sorted(rows[1])])
    quiet(few, output, block_cells=before).close()
    with quiet(study(), output, extend=True, block_cells=cells) as found:
        same(found, quiet(study()))
    assert list(output.parent.iterdir()) == [output]


def test_only_new_cells_are_computed(output, solved):
    heights, speeds = np.arange(1.0, 31), np.arange(5.0)
    keys = {"method": "exact"}
    quiet(study(heights[::2], speeds[:4], **keys), output).close()
    assert sum(solved) == 15 * 4
    solved.clear()
    with quiet(study(heights, speeds, **keys), output, extend=True, block_cells=7) as found:
        assert sum(solved) == 30 * 5 - 15 * 4
        same(found, quiet(study(heights, speeds, **keys)))


def test_old_cells_are_taken_from_the_file(output, monkeypatch):
    quiet(study(), output).close()
    with extending.Reused(output, study(np.append(HEIGHTS, 20.0))) as reused:
        assert reused.cells == 105
        assert reused.missing(0, 110).tolist() == [False] * 105 + [True] * 5
        assert reused.missing(104, 107).tolist() == [False, True, True]


def test_a_killed_extension_continues(output, monkeypatch):
    few, more = study(HEIGHTS[3:]), study()
    quiet(few, output).close()
    real = Solver.solve

    def failing(self, start, cells, *rest):
        if (start, cells.number) == (10, 5):
            raise SweepError("stop here")
        real(self, start, cells, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(Solver, "solve", failing)
        patch.setattr("sweep.system.forecast.Forecast.order", lambda self: iter(range(self.blocks)))
        with pytest.raises(SweepError, match="stop here"):
            quiet(more, output, extend=True, block_cells=5, workers=1)
    with sweep.open_result(output) as before:
        same(before, quiet(few))
    assert kept_blocks(output)
    with pytest.raises(SweepError, match="--extend"):
        quiet(more, output)
    with quiet(more, output, extend=True) as found:
        same(found, quiet(more))


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"heights": HEIGHTS[1:]}, r"axes\.height: 1 of its 21 values so far are not among the new ones, e\.g\. -1"),
        ({"heights": HEIGHTS[::-1]}, r"axes\.height: its values so far stand in another order"),
        ({"heights": np.append(HEIGHTS[:-1], np.nextafter(9.0, 10))}, "to the last digit"),
        ({"speeds": np.append(np.where(SPEEDS == 0, -0.0, SPEEDS), 2e4)}, "0 is not; extended, an axis keeps"),
        ({"heights": np.append(HEIGHTS, 20.0), "fixed": {"g": 1.6}}, "cannot be extended, for fixed"),
        ({"heights": np.append(HEIGHTS, 20.0), "rtol": 1e-3}, "cannot be extended, for rtol differs, too"),
        ({"heights": np.append(HEIGHTS, 20.0), "outputs": ["fall_time"], "along": {}}, "cannot be extended, for"),
        ({"heights": np.append(HEIGHTS, 20.0), "summary": {}}, "cannot be extended, for summary"),
    ],
)
def test_what_cannot_be_extended_is_told_and_kept(output, keys, told):
    quiet(study(), output).close()
    before = output.read_bytes()
    with pytest.raises(SweepError, match=told):
        quiet(study(**keys), output, extend=True)
    assert output.read_bytes() == before
    assert list(output.parent.iterdir()) == [output]


def test_a_damaged_result_is_not_extended(output):
    quiet(study(), output).close()
    with h5py.File(output, "r+") as file:
        file["fall_time"][3, 0] = 7.0
    with pytest.raises(SweepError, match="not whole"):
        quiet(study(np.append(HEIGHTS, 20.0)), output, extend=True)


def test_a_summary_and_a_zip_are_not_extended(output):
    quiet(study(summary={}), output).close()
    with pytest.raises(SweepError, match="holds a summary"):
        quiet(study(np.append(HEIGHTS, 20.0), summary={}), output, extend=True)
    zipped = output.with_name("zip.h5")
    quiet(study(HEIGHTS[:3], SPEEDS[:3], design="zip"), zipped).close()
    with pytest.raises(SweepError, match='design is not "product"'):
        quiet(study(HEIGHTS[:4], SPEEDS[:4], design="zip"), zipped, extend=True)


def test_extend_on_the_command_line(tmp_path, read, capsys):
    read('[axes.height]\nspacing = "log"\nstart = 1\nstop = 100\nnum = 11\n')
    path, output = str(tmp_path / "fall.toml"), str(tmp_path / "out.h5")
    assert main(["run", path, "-o", output, "--allow-import"]) == 0
    read('[axes.height]\nspacing = "log"\nstart = 1\nstop = 10000\nnum = 21\n')
    assert main(["run", path, "-o", output, "--allow-import"]) == 2
    assert "--extend computes the new cells alone" in capsys.readouterr().err
    assert main(["run", path, "-o", output, "--allow-import", "--extend"]) == 0
    assert "21 cells: 21 ok" in capsys.readouterr().out
    assert main(["verify", output]) == 0


GOLDEN = Path(__file__).parents[2] / "golden" / "format_2.h5"
"""Of foliot, by three methods, with cells that are refused; its version named its modules otherwise."""
TORQUES = [1e-4, 0.1, 0.5, 1.0, 30.0]


def kept_study(torques=TORQUES):
    axes = {"method": ["auto", "segments", "quadrature"], "mu": torques, "R": [0.0, 1e-3, np.nan]}
    fixed = {"phi0": {"value": 60, "unit": "degree"}, "a": 1.0}
    return sweep.study(kernel="foliot", outputs=["period", "amplitude"], rtol=1e-9, axes=axes, fixed=fixed)


def as_then(torques=TORQUES):
    """The study, its methods chosen as in the version that computed the result."""
    return replace(kept_study(torques), by_cell=False)


@pytest.fixture
def kept(output):
    return Path(shutil.copy(GOLDEN, output))


def test_a_result_of_an_earlier_version_opens_verifies_and_fits(kept, capsys):
    with sweep.open_result(kept) as found:
        same(found, quiet(as_then()).drop_vars("error_bound"))  # which came later
    assert main(["verify", str(kept)]) == 0
    assert main(["fit", str(kept), "--y", "period", "--x", "mu"]) == 0
    assert "whole" in capsys.readouterr().out


def test_a_result_of_an_earlier_version_is_extended_where_its_bits_are_still_the_same(kept, solved):
    torques = [1e-5, *TORQUES[:3], 0.7, *TORQUES[3:]]
    more = kept_study(torques)
    with pytest.raises(SweepError, match="those of another version it keeps if a sample"):
        quiet(more, kept)
    with quiet(more, kept, extend=True) as found:
        same(found, quiet(as_then(torques)))
        assert found.attrs["taken_over"].startswith("45 cells of another version, ")
        assert "source kernels" in json.loads(found.attrs["fingerprint"])
    assert main(["verify", str(kept)]) == 0


def test_a_result_of_an_earlier_version_becomes_one_of_this_version(kept):
    with quiet(kept_study(), kept, extend=True) as found:
        same(found, quiet(as_then()))
    before = kept.read_bytes()
    quiet(kept_study(), kept).close()
    assert kept.read_bytes() == before


def test_a_result_goes_on_with_methods_chosen_as_it_was_begun_and_is_chosen_anew_by_force(kept):
    """Cells without Coulomb friction have a method of their own, which `auto` took only where all cells were such."""
    more = kept_study([*TORQUES, 50.0])
    for torques in (TORQUES, [*TORQUES, 50.0]):
        with quiet(kept_study(torques), kept, extend=True) as found:
            same(found, quiet(as_then(torques)))
            assert sweep.study(found).by_cell is False
    with quiet(kept_study([*TORQUES, 50.0]), kept, force=True) as found:
        same(found, quiet(more))
        assert sweep.study(found).by_cell
        assert set(found.method_used[0, :, 0].values) == {0}
        assert not np.array_equal(found.method_used, quiet(as_then([*TORQUES, 50.0])).method_used)


@pytest.mark.parametrize("name", ["period", "status", "method_used", "error_bound"])
def test_a_result_of_an_earlier_version_with_other_bits_is_refused_and_kept(kept, monkeypatch, name):
    real = extending.Reused.fill

    def other(self, start, stop, arrays):
        real(self, start, stop, arrays)
        arrays[name].view("u1")[:1] ^= 1

    monkeypatch.setattr(extending.Reused, "fill", other)
    before = kept.read_bytes()
    with pytest.raises(SweepError, match=f"cannot be extended, for another version .* {name} of a cell was "):
        quiet(kept_study(), kept, extend=True)
    assert kept.read_bytes() == before
    assert list(kept.parent.iterdir()) == [kept]


def test_the_sample_has_old_cells_of_every_status_and_method(kept):
    with extending.Reused(kept, kept_study([1e-5, *TORQUES])) as reused:
        cells = {c.name: c.empty(54) for c in reused._columns}
        reused.fill(0, 54, cells)
        known = np.flatnonzero(~reused.missing(0, 54))
        kinds = list(zip(cells["status"].tolist(), cells["method_used"].tolist(), strict=True))
        sample = reused._sample()
    assert set(sample) <= set(known.tolist())
    assert {kinds[cell] for cell in sample} == {kinds[cell] for cell in known}
    assert len(sample) <= extending.SAMPLE * len({kinds[cell] for cell in known})


def test_a_result_without_the_error_bounds_of_its_inaccurate_cells_is_not_extended(output):
    loose = toy_studies.build(axes={"height": HEIGHTS, "v0": [0.5]}, method="rough", rtol=1e-12)
    quiet(loose, output).close()
    with extending.Reused(output, loose) as reused:
        assert (reused._numbers["status"][()] == Status.INACCURATE).any()
        reused.check_sample()
        reused._lacks = lambda name: name == "error_bound"
        with pytest.raises(SweepError, match="does not say what its INACCURATE values are right to"):
            reused.check_sample()


@pytest.mark.parametrize("retry", [False, True])
def test_how_many_cells_are_known_before_each_is_counted_exactly(tmp_path, retry):
    """As the masks of what is missing have it, for every number of a cell, and the one behind the last."""
    output = tmp_path / "out.h5"
    keys = {"kernel": "bad:RAISING", "outputs": ["fall_time"], "along": {}}
    small = study([2.0, 5.0, 11.0, 13.5], [0.0, 3.0], **keys)
    large = study([1.0, 2.0, 5.0, 11.0, 12.0, 13.5], [0.0, 0.5, 3.0], **keys)
    quiet(small, output).close()
    with extending.Retried(output, small) if retry else extending.Reused(output, large) as reused:
        size = 8 if retry else 18
        expected = np.r_[0, np.cumsum(~reused.missing(0, size))]
        assert reused.known_before(np.arange(size + 1)).tolist() == expected.tolist()
        assert expected[-1] == (6 if retry else 8)
