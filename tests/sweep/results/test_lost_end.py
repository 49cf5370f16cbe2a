"""A result whose last bytes never came, as of a copy that was interrupted: it has its whole length, and is refused."""

import shutil

import numpy as np
import pytest
from running import quiet, stone

import sweep
from sweep.cli import main
from sweep.store.store import unfinished_of

COMMANDS = (["show"], ["verify"], ["export", "-o", "out.csv"], ["diff", "whole.h5"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A fifth of the stones are thrown from below the ground: BAD_INPUT."""
    path = tmp_path_factory.mktemp("whole") / "out.h5"
    axes = {"height": np.concatenate([np.linspace(1.0, 90.0, 80), np.linspace(-20.0, -1.0, 20)]), "v0": np.arange(40.0)}
    quiet(stone(axes=axes, outputs=["fall_time"], along={}), path, block_cells=400).close()
    return path


def damages(content):
    """The file without some of its last bytes, filled up or not."""
    for lost in sorted({1, 2, 11, 12, 13, 28, 29, *np.geomspace(40, len(content) - 100, 14).astype(int).tolist()}):
        for fill in (b"\0", b"\xff", b"\x89", b""):
            damaged = content[:-lost] + fill * lost
            if damaged != content:
                yield damaged


@pytest.mark.parametrize("ended", [True, False])
def test_a_result_without_its_last_bytes_is_refused_whoever_reads_it(whole, tmp_path, monkeypatch, capsys, ended):
    monkeypatch.chdir(tmp_path)
    shutil.copy(whole, "whole.h5")
    path = tmp_path / "out.h5"
    place = path if ended else unfinished_of(path)
    for number, damaged in enumerate(damages(whole.read_bytes())):
        place.write_bytes(damaged)
        with pytest.raises(sweep.SweepError, match="damaged"):
            sweep.open_result(path).load()
        assert not sweep.verify(path).whole
        for command in COMMANDS if number % 25 == 1 else ():
            assert main([*command, str(path)]) == 2
            told = capsys.readouterr()
            assert "damaged" in told.err + told.out
    shutil.copy(whole, place)
    assert sweep.open_result(path).load().sizes == {"height": 100, "v0": 40}
