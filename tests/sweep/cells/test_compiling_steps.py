"""The clock that leaves compiling out, what counts as compiled, and the table of what it took: on simulated clocks."""

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace

import pytest
import toy

from sweep.cells import compiling
from sweep.cells.compiling import Compiling, WorkClock


class Seconds:
    """A clock that is set by hand."""

    def __init__(self, monkeypatch):
        self.now = 0.0
        monkeypatch.setattr(compiling.time, "perf_counter", lambda: self.now)


@pytest.fixture
def seconds(monkeypatch):
    return Seconds(monkeypatch)


@pytest.fixture
def table(tmp_path, monkeypatch):
    monkeypatch.setattr(compiling, "machine_code_folder", lambda: tmp_path / "code")
    return tmp_path / "compile_seconds.json"


def test_compiling_within_compiling_stops_the_clock_once(seconds):
    clock, readings = WorkClock(), []
    for now, change in [(1, None), (2, clock._start), (3, clock._start), (5, clock._end), (7, clock._end), (8, None),
                        (9, clock._start), (9.5, clock._end), (10, None)]:  # fmt: skip
        seconds.now = float(now)
        if change is not None:
            change(None)
        readings.append((clock(), clock.flag.value))
    assert readings == [
        (1.0, 0), (2.0, 1), (2.0, 2), (2.0, 1), (2.0, 0), (3.0, 0), (4.0, 1), (4.0, 0), (4.5, 0),
    ]  # fmt: skip


def test_what_began_before_it_was_watched_is_left_out(seconds):
    clock = WorkClock()
    clock._end(None)
    seconds.now = 3.0
    assert (clock(), clock.flag.value) == (3.0, 0)


def test_numba_is_watched_once_and_only_if_it_is_loaded(monkeypatch):
    registered = []
    event = SimpleNamespace(Listener=object, register=lambda kind, listener: registered.append((kind, listener)))
    clock = WorkClock()
    monkeypatch.setitem(compiling.sys.modules, "numba.core.event", None)
    clock.watch()
    assert registered == []
    monkeypatch.setitem(compiling.sys.modules, "numba.core.event", event)
    clock.watch()
    clock.watch()
    ((kind, listener),) = registered
    assert kind == "numba:compiler_lock"
    listener.on_start(None)
    assert clock.flag.value == 1
    listener.on_end(None)
    assert clock.flag.value == 0


def test_a_function_with_signatures_is_cold_until_it_has_one(monkeypatch):
    monkeypatch.setattr(compiling, "is_kept", lambda function: function.kept)
    for signatures, kept, cold in [([], False, True), ([], True, False), (["f8"], False, False)]:
        own = SimpleNamespace(signatures=signatures, kept=kept)
        inner = SimpleNamespace(compiled=SimpleNamespace(signatures=signatures), kept=kept)
        assert [compiling._cold(own), compiling._cold(inner)] == [cold, cold]
        assert [compiling._cold(own), compiling._cold(inner)] == [cold, cold]


def test_of_other_functions_of_kernels_the_first_call_counts(monkeypatch):
    monkeypatch.setattr(compiling, "_called", set())

    def ours():
        pass

    def theirs():
        pass

    ours.__module__, theirs.__module__ = "kernels.foliot.cycle", "kernelsmith"
    assert [compiling._cold(f) for f in (ours, theirs, ours, theirs)] == [True, False, False, False]
    ours.__module__ = "kernels.foliot.cycle"
    nameless = SimpleNamespace()
    assert not compiling._cold(nameless)


class Cold:
    """A function that takes so long when it is called first."""

    def __init__(self, seconds, taken):
        self.seconds, self.taken, self.signatures, self.calls = seconds, taken, [], []
        self.__name__ = "cold"

    def __call__(self, *columns):
        self.calls.append(columns)
        if not self.signatures:
            self.seconds.now += self.taken
        self.signatures = ["f8"]


@pytest.mark.parametrize(("taken", "found"), [(1.0, {}), (1.25, {"exact": 1.25})])
def test_seconds_are_kept_of_what_takes_longer_than_is_silent(seconds, monkeypatch, taken, found):
    monkeypatch.setattr(compiling, "is_kept", lambda function: False)
    cold = Cold(seconds, taken)
    exact = dataclasses.replace(toy.KERNEL.methods[1], solve=cold)
    watched = Compiling(dataclasses.replace(toy.KERNEL, methods=(exact,)), "toy:KERNEL")
    solve = watched.kernel.methods[0].solve
    solve(1, 2)
    solve(3)
    assert cold.calls == [(1, 2), (3,)]
    assert watched.seconds == found


def test_seconds_of_a_method_and_its_bound_are_added_also_where_it_raises(seconds):
    watched = Compiling(toy.KERNEL, "toy:KERNEL")

    def failing(taken):
        with watched._timed("exact"):
            seconds.now += taken
            raise ValueError("no")

    for taken in (2.0, 3.0):
        with pytest.raises(ValueError, match="no"):
            failing(taken)
    assert watched.seconds == {"exact": 5.0}


def test_a_line_is_told_after_a_while_and_not_after_the_end(monkeypatch):
    made = []

    class Timer:
        def __init__(self, *args):
            self.args, self.started, self.cancelled = args, False, False
            made.append(self)

        def start(self):
            assert self.daemon
            self.started = True

        def cancel(self):
            self.cancelled = True

    monkeypatch.setattr(compiling.threading, "Timer", Timer)
    watched = Compiling(toy.KERNEL, "toy:KERNEL")
    with watched._timed("exact"):
        assert made[0].started
        assert not made[0].cancelled
    assert made[0].cancelled
    assert made[0].args == (1.0, watched._tell, ["exact"])


def test_what_is_told_names_the_time_of_the_last_time(table, monkeypatch):
    told = []
    watched = Compiling(toy.KERNEL, "toy:KERNEL", told.append)
    watched._tell("exact")
    table.write_text('{"toy:KERNEL.exact": 12.3, "toy:KERNEL.rough": 0}')
    watched._tell("exact")
    watched._tell("rough")
    monkeypatch.setattr(compiling, "machine_code_folder", lambda: None)
    watched._tell("exact")
    plain = "compiling toy:KERNEL.{} ..."
    assert told == [plain.format("exact"), plain.format("exact") + " (about 12 s when last done)",
                    plain.format("rough"), plain.format("exact")]  # fmt: skip
    Compiling(toy.KERNEL, "toy:KERNEL")._tell("exact")


def test_what_was_measured_is_added_to_the_table_in_hundredths(table):
    watched = Compiling(toy.KERNEL, "toy:KERNEL")
    watched.remember()
    assert not table.exists()
    table.write_text('{"foliot.closed": 3.5, "toy:KERNEL.exact": 7}')
    watched.seconds = {"exact": 1.23456}
    watched.remember()
    assert json.loads(table.read_text()) == {"foliot.closed": 3.5, "toy:KERNEL.exact": 1.23}
    assert list(table.parent.iterdir()) == [table]


def test_without_a_folder_nothing_is_remembered(table, monkeypatch):
    monkeypatch.setattr(compiling, "machine_code_folder", lambda: None)
    watched = Compiling(toy.KERNEL, "toy:KERNEL")
    watched.seconds = {"exact": 1.0}
    watched.remember()
    assert not table.exists()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('{"a": 1, "b": "2.5"}', {"a": 1.0, "b": 2.5}),
        ('{"a": 0, "b": -1, "c": 1e4, "d": 9999.5, "e": 1e-3, "f": 2e4}', {"d": 9999.5, "e": 1e-3}),
        ('{"a": NaN}', {}),
        ('{"a": null}', {}),
        ("[1]", {}),
        ("{", {}),
    ],
)
def test_seconds_that_cannot_be_are_none(tmp_path, text, found):
    (tmp_path / "table").write_text(text)
    assert compiling._read(tmp_path / "table") == found
    assert compiling._read(tmp_path / "none") == {}


def test_a_table_that_cannot_be_written_is_no_fault(tmp_path):
    compiling._write(tmp_path / "none" / "table", {"a": 1.0})
    compiling._write(tmp_path / "table", {"b": 1.0, "a": 2.5})
    assert (tmp_path / "table").read_text() == '{\n "a": 2.5,\n "b": 1.0\n}'
    assert list(Path(tmp_path).iterdir()) == [tmp_path / "table"]
