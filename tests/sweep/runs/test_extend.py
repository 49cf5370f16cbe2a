"""A finished result grows by the new cells only, and ends as one run would have made it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from running import quiet, same

import sweep
from sweep.cli import main
from sweep.system.errors import SweepError


@pytest.fixture
def output(tmp_path):
    return tmp_path / "out.h5"


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


def test_a_result_of_an_earlier_version_is_extended_where_its_bits_are_still_the_same(kept):
    torques = [1e-5, *TORQUES[:3], 0.7, *TORQUES[3:]]
    more = kept_study(torques)
    with pytest.raises(SweepError, match="those of another version it keeps if a sample"):
        quiet(more, kept)
    with quiet(more, kept, extend=True) as found:
        same(found, quiet(as_then(torques)))
        assert found.attrs["taken_over"].startswith("45 cells of another version, ")
        assert "source kernels" in json.loads(found.attrs["fingerprint"])
    assert main(["verify", str(kept)]) == 0


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
