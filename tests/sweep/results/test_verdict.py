"""What is told of damage: which cells, how many places, and how a verdict reads."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sweep.results import verify as module
from sweep.results.verify import Verdict


def test_a_verdict_reads_as_one_line_or_one_for_each_finding():
    assert str(Verdict(Path("a.h5"), True, "7 bytes checked", ())) == "a.h5: whole; 7 bytes checked"
    found = Verdict(Path("a.h5"), False, "7 bytes checked", ("one", "two"))
    assert str(found).splitlines() == ["a.h5: not whole; 7 bytes checked", "  one", "  two"]


def unfinished(done):
    blocks = SimpleNamespace(count=len(done), bounds=lambda k: (1000 * k, 1000 * (k + 1)))
    layout = SimpleNamespace(work_name="cells", work=SimpleNamespace(blocks=blocks))
    return SimpleNamespace(layout=layout, done=lambda name: np.array(done, bool))


@pytest.mark.parametrize(("missing", "told"), [(1, 1), (8, 8), (9, 9), (20, 9)])
def test_eight_missing_blocks_are_told_and_the_rest_counted(missing, told):
    found = module._unfinished(Path("a.h5"), unfinished([True] * 3 + [False] * missing), [])
    assert not found.whole
    assert found.checked == f"unfinished, 3 of {3 + missing} blocks there and checked"
    assert len(found.findings) == told
    assert found.findings[0] == "missing: cells 3,000 to 4,000"
    if missing > 8:
        assert found.findings[-1] == f"missing: {missing - 8} more"


def test_an_unfinished_result_of_which_all_is_there_is_told_to_be_run_again():
    found = module._unfinished(Path("a.h5"), unfinished([True, True]), [])
    assert found.findings == ("all blocks are there, but it has not ended; run the sweep again to finish",)
    assert module._unfinished(Path("a.h5"), unfinished([True]), ["damaged"]).findings == ("damaged",)


@pytest.mark.parametrize(("blocks", "cure"), [((0,), True), ((), True), (None, False)])
def test_a_damaged_result_is_told_to_be_repaired_where_it_can_be(monkeypatch, blocks, cure):
    monkeypatch.setattr(module, "verify", lambda path: Verdict(path, False, "checked", ("damaged",), blocks))
    with pytest.raises(module.SweepError) as caught:
        module.check_whole(Path("a.h5"))
    assert ("sweep run --repair computes damaged cells again" in str(caught.value)) is cure
    monkeypatch.setattr(module, "verify", lambda path: Verdict(path, True, "checked", ()))
    assert module.check_whole(Path("a.h5")) is None


@pytest.mark.parametrize(
    ("bad", "places"),
    [
        ([0], [(0, 10)]),
        ([0, 1, 2, 4], [(0, 30), (40, 50)]),
        ([3, 5, 6], [(30, 40), (50, 70)]),
        ([], []),
    ],
)
def test_neighbouring_damaged_blocks_are_told_together(bad, places):
    blocks = SimpleNamespace(bounds=lambda k: (10 * k, 10 * k + 10))
    told = [f"y: damaged between its cells {first} and {last}" for first, last in places]
    assert list(module._runs("y", blocks, bad)) == told


@pytest.mark.parametrize(("count", "rest"), [(8, []), (9, ["y: damaged in 1 more places"])])
def test_eight_damaged_places_are_told_and_the_rest_counted(count, rest):
    blocks = SimpleNamespace(bounds=lambda k: (k, k + 1))
    assert list(module._runs("y", blocks, list(range(0, 2 * count, 2))))[8:] == rest
