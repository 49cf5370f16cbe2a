"""Runs that are killed, files that are damaged, calls that fail: nothing acknowledged is lost, no damage is missed."""

import errno
import random

import numpy as np
import pytest
import toy_studies
from havoc import damaged_result, damaged_unfinished, numbers, study, unfinished
from killing import KINDS, Torture, Victims, perform, prepare
from running import fail_on, quiet, same, told_by

import sweep
from sweep.results.verify import verify
from sweep.store.store import lock_of

KILLS, DAMAGED = 8, 8
FAULTS = [("open_file", errno.EMFILE), ("write", errno.ENOSPC), ("reserve", errno.ENOSPC), ("fsync", errno.EIO),
          ("sync_numbers", errno.EIO), ("rename", errno.EIO), ("remove", errno.EIO)]  # fmt: skip
STEP = 11
"""Of the calls that may fail in an extension or a summary, the first ones and every so manieth do; 1: each does."""
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


def falls(count, **keys):
    return toy_studies.build(axes={"height": np.arange(1.0, count + 1)}, **keys)


def an_extension(path):
    quiet(falls(30), path, block_cells=10).close()
    return falls(60), {"extend": True}


def a_summary(path):
    return falls(60, summary={"outputs": {"fall_time": ["min", "mean"]}}), {}


@pytest.mark.parametrize("prepared", [an_extension, a_summary])
@pytest.mark.parametrize(("name", "number"), FAULTS)
def test_whichever_call_fails_an_extension_and_a_summary_continue(tmp_path, prepared, name, number):
    turn, failed = 0, True
    while failed:
        turn += 1 if turn < 3 else STEP
        output = tmp_path / f"out{turn}.h5"
        made, keys = prepared(output)
        before = output.read_bytes() if output.exists() else None
        with pytest.MonkeyPatch.context() as patch:
            calls = fail_on(patch, name, turn, number)
            told = told_by(lambda: quiet(made, output, block_cells=10, workers=1, **keys).close())  # noqa: B023
            failed = len(calls) >= turn
        assert "\n" not in told
        assert not told or before is None or output.read_bytes() == before or verify(output).whole
        with quiet(made, output, **keys) as found:
            same(found, quiet(made))
        left = {path.name for path in tmp_path.iterdir() if path.name.startswith(output.name)}
        assert left - {f"{output.name}.lock"} == {output.name}
    assert turn > 1


def test_verify_tells_of_a_disk_that_fails_in_one_line(whole, monkeypatch):
    for number in (errno.EIO, errno.EMFILE):
        with monkeypatch.context() as patch:
            fail_on(patch, "open_file", 1, number)
            told = told_by(lambda: verify(whole))
            assert told
            assert "\n" not in told
    assert sweep.verify(whole).whole
