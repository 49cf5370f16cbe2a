"""Runs that are killed, files that are damaged, calls that fail: nothing acknowledged is lost, no damage is missed."""

import errno
import random

import pytest
from havoc import damaged_result, damaged_unfinished, numbers, study, unfinished
from killing import KINDS, Torture, Victims, perform, prepare
from running import fail_on, quiet, told_by

import sweep
from sweep.results.verify import verify
from sweep.store.store import lock_of

KILLS, DAMAGED = 8, 8
SHAPES = (100, 400, 3000)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished result."""
    path = tmp_path_factory.mktemp("whole") / "out.h5"
    quiet(study(), path, block_cells=300).close()
    return path


@pytest.fixture
def rng():
    return random.Random()


def test_killed_at_any_moment_a_run_loses_nothing_and_ends_with_the_same_bits(tmp_path, rng):
    with Victims() as victims:
        found = Torture(rng, victims, tmp_path, SHAPES)
        for kind in KINDS:
            found.kill(kind, KILLS // len(KINDS))
    assert found.kills >= KILLS
    assert found.acknowledged > 0
    assert (found.lost, found.different) == (0, 0)


def test_a_lock_that_a_run_left_when_it_was_killed_at_its_very_end_is_removed(tmp_path):
    for kind in KINDS:
        output = tmp_path / f"{kind}.h5"
        prepare(kind, output)
        perform(kind, output, 2, 300)
        bits = output.read_bytes()
        lock_of(output).touch()
        perform(kind, output, 2, 300)
        assert not lock_of(output).exists()
        assert output.read_bytes() == bits


@pytest.fixture(scope="module")
def strange(tmp_path_factory):
    """The bytes of a result of another study, that stand where those of the study do."""
    path = tmp_path_factory.mktemp("strange") / "out.h5"
    quiet(study(fixed={"g": 1.6}), path, block_cells=300).close()
    return path.read_bytes()


def test_damage_of_an_unfinished_result_is_found_and_computed_again(whole, strange, tmp_path, rng):
    (tmp_path / "scratch").mkdir()
    path = unfinished(tmp_path / "out.h5")
    bits = numbers(whole)
    wrong = [damaged_unfinished(rng, path, strange, tmp_path / "scratch", bits) for _ in range(DAMAGED)]
    assert [(kind, what) for kind, what in wrong if what] == []


def test_damage_of_a_result_is_found_by_verify_and_repaired(whole, strange, tmp_path, rng):
    bits = numbers(whole)
    wrong = [damaged_result(rng, whole, strange, tmp_path, bits) for _ in range(3 * DAMAGED)]
    assert [(kind, what) for kind, what in wrong if what] == []


def test_verify_tells_of_a_disk_that_fails_in_one_line(whole, monkeypatch):
    for number in (errno.EIO, errno.EMFILE):
        with monkeypatch.context() as patch:
            fail_on(patch, "open_file", 1, number)
            told = told_by(lambda: verify(whole))
            assert told
            assert "\n" not in told
    assert sweep.verify(whole).whole
