"""What the disk takes for what is written, on a simulated clock."""

import contextlib

import pytest
from running import quiet, tall

from sweep.store.write_back import READ_BACK_SECONDS, WriteBack
from sweep.system.forecast import Forecast

MB = 1 << 20


def test_what_is_to_come_takes_as_long_as_what_came():
    now = 0.0
    found = WriteBack(100 * MB, lambda: now)
    assert found.seconds() == (READ_BACK_SECONDS, READ_BACK_SECONDS)
    found.put = 10 * MB
    with found.syncing():
        now += 2.0
        found.put += 5 * MB
        # nothing is known yet but that it has taken two seconds
        assert found.seconds() == (2.0 + READ_BACK_SECONDS, 2.0 + READ_BACK_SECONDS)
    assert (found.put, found.synced) == (15 * MB, 10 * MB)
    assert found.seconds() == pytest.approx((1.0 + READ_BACK_SECONDS, 18.0 + READ_BACK_SECONDS))
    with found.syncing():
        now += 0.4
        assert found.seconds() == pytest.approx((0.6 + READ_BACK_SECONDS, 17.6 + READ_BACK_SECONDS))
    assert found.seconds()[1] == pytest.approx(13.6 + READ_BACK_SECONDS)
    found.put += 1
    with found.syncing():
        now += 5.0
    assert found.seconds()[1] == pytest.approx(13.6 + READ_BACK_SECONDS)


def test_a_sync_may_end_while_it_is_asked_for_the_time():
    sync = contextlib.ExitStack()
    found = WriteBack(MB, lambda: sync.close() or 1.0)
    sync.enter_context(found.syncing())
    assert found.seconds() == (READ_BACK_SECONDS, READ_BACK_SECONDS)


def test_a_run_into_a_file_counts_every_byte_to_come(tmp_path, monkeypatch):
    seen, real = [], Forecast.order

    def order(forecast):
        seen.append(forecast.ending.__self__)
        assert seen[0].total == 60 * (8 + 4 + 1 + 1)
        return real(forecast)

    monkeypatch.setattr(Forecast, "order", order)
    quiet(tall(60), tmp_path / "out.h5", block_cells=10, workers=1).close()
    assert seen[0].total == seen[0].put == seen[0].synced
