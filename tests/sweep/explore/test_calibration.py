"""Trial runs: how many cells they have, and what is concluded from two of them."""

import math

import numpy as np
import pytest
from toy_studies import build

from sweep.explore import calibration
from sweep.explore.calibration import Calibration, Timed, thinned
from sweep.system.errors import SweepError


def trial(cells=10**6, cell_seconds=1e-4, cell_bytes=10.0, workers=2):
    study = build(axes={"height": np.arange(1.0, 101.0), "v0": np.arange(10.0)})
    return Calibration(study, cells, 100, cell_seconds, cell_bytes, workers)


def tried(monkeypatch, tmp_path, fault=None, **keys):
    """How many cells the longer trial has, None where nothing is tried; and what is found."""
    asked = []

    def forecast(self, path, some):
        asked.append(some)
        assert path.parent.parent == tmp_path
        assert path.parent.is_dir()
        if fault is not None:
            raise fault
        return 7.0

    monkeypatch.setattr(Calibration, "_forecast", forecast)
    found = trial(**keys).seconds(tmp_path)
    assert list(tmp_path.iterdir()) == []
    return (asked or [None])[0], found


@pytest.mark.parametrize(
    ("keys", "some"),
    [
        ({"cell_bytes": 1e-9}, 9999),  # half a second of 1e-4 s on two cores
        ({"cell_seconds": 0.0, "cell_bytes": 3000.0}, 44739),  # 128 MiB
        ({"cell_seconds": 1e-5, "cell_bytes": 1500.0}, 50_000),  # 5 us of computing and as long for the disk
        ({"cells": 50}, 50),
        ({"cells": 3, "cell_seconds": 0.1}, 3),
    ],
)
def test_the_longer_trial_takes_half_a_second_or_less(monkeypatch, tmp_path, keys, some):
    asked, found = tried(monkeypatch, tmp_path, **keys)
    assert asked == pytest.approx(some, abs=1)
    assert found == 7.0


@pytest.mark.parametrize(
    ("keys", "nothing"),
    [
        ({"cell_seconds": 0.5 / 16.1, "workers": 1}, False),
        ({"cell_seconds": 0.5 / 15.9, "workers": 1}, True),
        ({"cells": 3, "cell_seconds": 0.126}, True),
        ({"cells": 3, "cell_seconds": 0.124}, False),
    ],
)
def test_where_a_few_cells_take_too_long_nothing_is_tried(monkeypatch, tmp_path, keys, nothing):
    asked, found = tried(monkeypatch, tmp_path, **keys)
    assert (asked is None) is math.isnan(found) is nothing


@pytest.mark.parametrize("fault", [OSError(28, "full"), SweepError("no")])
def test_a_trial_that_fails_tells_nothing(monkeypatch, tmp_path, fault):
    assert math.isnan(tried(monkeypatch, tmp_path, fault)[1])
    with pytest.raises(ValueError, match="a fault of ours"):
        tried(monkeypatch, tmp_path, ValueError("a fault of ours"))


@pytest.mark.parametrize(
    ("times", "seconds"),
    [
        ([(10, 9.0), (10, 2.0), (90, 6.0)], 6.0 + 0.05 * 910),  # the first run compiles, and does not count
        ([(10, 9.0), (10, 2.0), (1000, 6.0)], 6.0),
        ([(10, 9.0), (10, 2.0), (10, 5.0)], 500.0),
        ([(10, 9.0), (10, 2.0), (90, 1.0)], 1.0 + 0.5 * 0.02 * 910),  # no cheaper than half of what is thought
    ],
)
def test_two_trials_tell_the_slope(monkeypatch, times, seconds):
    told, sizes = iter(times), []

    def timed(self, study, path):
        sizes.append(math.prod(study.grid_shape.values()))
        return Timed(*next(told))

    monkeypatch.setattr(Calibration, "_timed", timed)
    found = trial(1000, 0.04, 0.0)._forecast(None, 400)
    assert found == pytest.approx(seconds)
    assert sizes[0] == sizes[1] == math.prod(thinned(trial().study, 50).grid_shape.values())
    assert sizes[2] == 400


def test_values_of_a_thinned_axis_are_from_the_middles_of_equal_shares():
    axis = trial().study.axes["height"]
    assert calibration._some(axis, 4).values.tolist() == [13.0, 38.0, 63.0, 88.0]
    assert calibration._some(axis, 1).values.tolist() == [51.0]
    words = build(axes={"method": ["exact", "rough", "auto"], "height": [1.0, 2.0]}).axes["method"]
    assert calibration._some(words, 1).words == ("rough",)


@pytest.mark.parametrize(
    ("cells", "shape"), [(400, (40, 10)), (100, (10, 10)), (64, (8, 8)), (1, (8, 8)), (2000, (100, 10))]
)
def test_the_longest_axis_is_thinned_first_and_keeps_eight_values(cells, shape):
    assert tuple(thinned(trial().study, cells).grid_shape.values()) == shape
    assert list(thinned(trial().study, cells).axes) == ["height", "v0"]


def test_a_single_axis_is_thinned_to_the_last_cell():
    study = build(axes={"height": np.arange(1.0, 101.0)})
    assert thinned(study, 1).axes["height"].values.tolist() == [51.0]
    assert len(thinned(study, 5).axes["height"]) == 5
