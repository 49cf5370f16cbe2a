"""A forecast's single steps, by hand: what is thought of a block, of how many cores, how sure, and in which order."""

from itertools import islice

import numpy as np
import pytest

from sweep.system import forecast
from sweep.system.forecast import GOLDEN, Forecast


class Told:
    """A clock that is set by hand, and a forecast by it."""

    def __init__(self, weights, jobs=None):
        self.now = 0.0
        self.forecast = Forecast(
            np.array(weights, float), range(len(weights)) if jobs is None else jobs, lambda: self.now
        )

    def done(self, *seconds, begun=None):
        """The first blocks took so long, and began then."""
        self.forecast._seconds[: len(seconds)] = seconds
        self.forecast._begun[: len(seconds)] = np.zeros(len(seconds)) if begun is None else begun
        self.forecast._left[: len(seconds)] = False
        return np.arange(len(seconds))


def test_what_is_left_by_hand():
    """One core, a block of two seconds done, one begun a second ago: others take 1.25 * 2 s, rather too long."""
    told = Told([1, 1, 1, 1])
    list(told.forecast.order())
    told.forecast.begin(0)
    told.now = 2.0
    assert told.forecast.left is None
    told.forecast.end(0)
    told.forecast.begin(1)
    told.now = 3.0
    assert told.forecast.left == pytest.approx(1.5 + 2.5 + 2.5)
    told.forecast.ending = lambda: (1.0, 7.0)
    assert told.forecast.left == pytest.approx(7.5)
    told.forecast.ending = lambda: (1.0, 8.0)
    assert told.forecast.left == 8.0
    assert told.forecast.blocks == 3
    told.now = 7.0  # the block at work is late; it takes as long again
    assert told.forecast.left == pytest.approx(5.0 + 2.5 + 2.5 + 1.0)


def test_when_all_is_computed_only_the_disk_is_waited_for():
    told = Told([1.0, 1.0])
    list(told.forecast.order())
    told.done(1.0, 1.0)
    told.forecast.ending = lambda: (3.0, 9.0)
    assert told.forecast.left == 3.0


def test_cores_are_what_is_done_over_what_has_passed():
    told = Told(np.ones(4))
    measured = told.done(2.0, 3.0)
    told.forecast._start = 1.0
    assert told.forecast._cores(measured, np.array([1.0, 0.0]), 4.0) == 2.0
    told.forecast._away = 2.0  # half of a batch is on its way, of which nothing is told
    assert told.forecast._cores(measured, np.array([1.0, 0.0]), 4.0) == 2.5
    told.forecast._away = 0.0
    assert told.forecast._cores(measured, np.zeros(2), 1.0) == pytest.approx(5e9)


def test_blocks_from_elsewhere_began_with_those_that_came_together_with_them():
    told = Told(np.ones(4))
    told.forecast._start = 0.0
    told.now = 10.0
    told.forecast.end(0, 0.5, 2.0)
    assert (told.forecast._begun[0], told.forecast._start, told.forecast._away) == (8.0, 8.0, 2.0)
    told.now = 12.0
    told.forecast.end(1, 3.0, 1.0)
    assert (told.forecast._begun[1], told.forecast._start, told.forecast._away) == (9.0, 8.0, 3.0)
    told.forecast.end(2, 0.0)
    assert (told.forecast._away, told.forecast._first_end) == (3.0, 10.0)
    assert told.forecast._seconds[2] == 1e-9
    assert Told([0.0, 2.0]).forecast._weights.tolist() == [1e-9, 2.0]


def test_first_blocks_of_workers_are_left_out_once_four_others_are_done():
    told = Told(np.ones(6))
    measured = told.done(*np.ones(6), begun=[0, 0, 5, 6, 7, 8])
    told.forecast._first_end = 5.0
    assert told.forecast._settled(measured).tolist() == [2, 3, 4, 5]
    assert told.forecast._settled(measured[:5]).tolist() == [0, 1, 2, 3, 4]


def test_few_blocks_took_rather_as_many_times_their_guess_as_all_together():
    told = Told([1.0, 2.0, 4.0])
    ratios = told.forecast._ratios(told.done(3.0, 4.0))
    assert ratios == pytest.approx([3 * 2 / 18 + 7 / 3 * 16 / 18, 2 * 2 / 18 + 7 / 3 * 16 / 18])


def test_between_blocks_a_straight_line_tells_what_one_would_be_taken_for():
    found = forecast._between(np.array([0, 1, 3, 4]), np.array([0.0, 10.0, 20.0, 40.0]))
    assert found == pytest.approx([10.0, 20 / 3, 30.0, 20.0])


def test_what_is_expected_of_other_blocks_is_interpolated_between_those_around():
    told = Told([1.0, 1.0, 3.0, 1.0, 1.0])
    told.done(2.0, 1.0, 6.0, 4.0, 1.0)
    low, high = told.forecast._ratios(np.array([0, 3]))
    found = told.forecast._expected(np.array([0, 3]))
    steps = np.array([0, 1, 2, 3, 3]) / 3 * (high - low)
    assert found == pytest.approx([1, 1, 3, 1, 1] * (low + steps))
    assert told.forecast._expected(np.array([], int)).tolist() == [1, 1, 3, 1, 1]


@pytest.mark.parametrize("number", [8, 12, 13, 30])
def test_blocks_are_corrected_by_the_twelve_that_were_thought_to_take_about_as_long(number):
    rng = np.random.default_rng(number)
    told = Told(rng.uniform(1, 9, 40))
    measured = told.done(*rng.uniform(1, 9, number))
    ratios = told.forecast._ratios(measured)
    thought = told.forecast._weights * np.interp(np.arange(40), measured, ratios)
    pairs = sorted(zip(told.forecast._without(measured, ratios), told.forecast._seconds[:number], strict=True))
    factors = []
    for one in thought:
        below = sum(guess < one for guess, _ in pairs)
        first = min(max(below - 6, 0), max(number - 12, 0))
        some = pairs[first : first + 12]
        factors.append(sum(took for _, took in some) / sum(guess for guess, _ in some))
    assert told.forecast._expected(measured) == pytest.approx(thought * factors)


def test_seven_blocks_are_too_few_to_correct_by():
    told = Told(np.arange(1.0, 21))
    measured = told.done(*np.ones(7))
    thought = told.forecast._weights * np.interp(np.arange(20), measured, told.forecast._ratios(measured))
    assert told.forecast._expected(measured) == pytest.approx(thought)


def test_the_standard_error_of_a_sum():
    told = Told([1.0, 2.0, 1.0, 1.0])
    expected = np.array([1.0, 3.0])
    assert told.forecast._standard_error(told.done(1.0), expected) == 0.5
    assert told.forecast._standard_error(told.done(1.0, 1.0), expected) == pytest.approx(0.5 / 2**0.5)
    measured = told.done(1.0, 3.0, 2.0)
    # by the neighbours: 2 * 1, (1 + (2 - 1) / 2) * ..., in ratios 1, 1.5, 2: then scaled to the six seconds
    without = np.array([1 * 1.5, 2 * (1.0 + 2.0) / 2, 1 * 1.5])
    without *= 6 / without.sum()
    variance = ((np.array([1.0, 3.0, 2.0]) - without) ** 2).sum() / (without**2).sum()
    wanted = (0.25 / 3 + variance * (1 / 3 + (1 / 4) ** 2 + (3 / 4) ** 2)) ** 0.5
    assert told.forecast._standard_error(measured, expected) == pytest.approx(wanted)
    wild = told.done(1e-3, 1e3, 1e-3)
    assert told.forecast._standard_error(wild, expected) == 1.0


@pytest.mark.parametrize(("blocks", "lead"), [(1, 0), (20, 5), (31, 7), (32, 8), (100, 8), (144, 9), (4096, 256)])
def test_blocks_in_the_lead(blocks, lead):
    told = Told(np.ones(blocks))
    looked = []
    told.forecast._dear_first = lambda jobs: (looked.append(len(jobs)), jobs)[1]
    found = list(told.forecast.order())
    assert looked[0] == blocks - lead
    assert found == np.argsort(np.arange(blocks) * GOLDEN % 1.0).tolist()


def test_after_the_lead_a_fourth_is_from_anywhere_and_others_are_the_dearest():
    told = Told(np.ones(100))
    told.forecast._dear_first = lambda jobs: np.sort(jobs)[::-1]
    found = list(told.forecast.order())
    anywhere = np.argsort(np.arange(100) * GOLDEN % 1.0)
    waiting = anywhere[8:]
    some = [*waiting[:2], *np.sort(waiting)[::-1]]
    assert found[:8] == anywhere[:8].tolist()
    assert found[8:16] == list(dict.fromkeys(some))[:8]
    assert sorted(found) == list(range(100))


@pytest.mark.parametrize(("measured", "blocks", "chosen"), [(35, 100, 8), (36, 100, 9), (0, 288, 8), (0, 320, 9)])
def test_so_many_are_chosen_before_all_are_looked_at_again(measured, blocks, chosen):
    told = Told(np.ones(blocks))
    waiting = []
    told.forecast._dear_first = lambda jobs: (waiting.append(len(jobs)), jobs)[1]
    told.forecast._measured = lambda: np.arange(measured)
    list(islice(told.forecast.order(), blocks))
    assert waiting[0] - waiting[1] == chosen


@pytest.mark.parametrize(
    ("seconds", "order"),
    [
        ([1.0, 1.0, 1.49], [0, 1, 2]),
        ([1.0, 1.0, 1.51], [2, 0, 1]),
        ([1.0, 1.4, 1.3, 2.9, 6.0, 3.0], [4, 3, 5, 0, 1, 2]),
    ],
)
def test_blocks_come_by_powers_of_two_where_one_is_half_as_dear_again_as_the_median(seconds, order):
    told = Told(np.r_[9.0, seconds])
    jobs = np.arange(1, len(seconds) + 1)
    found = told.forecast._dear_first(jobs)
    assert (found - 1).tolist() == order
    assert told.forecast.seconds(1) == 1.0
