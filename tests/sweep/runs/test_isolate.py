"""What cells in processes of their own may take, and what is said of those that took longer, by hand."""

import sys
import time
from concurrent.futures import Future
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from running import tall

from sweep.runs import isolate
from sweep.runs.isolate import Died, IsolatedSolver, Limits, Processes, awaited, kernel_paths, limits_of


@pytest.mark.parametrize(
    ("limits", "cells", "seconds"),
    [
        (Limits(60.0, 0.01), 1, 60.0),
        (Limits(60.0, 0.01), 2, 1.0 + 10 * 0.01 * 2),
        (Limits(0.5, 0.01), 3, 0.5 + 10 * 0.01 * 3),
        (Limits(None, 0.59), 1, 60.0),
        (Limits(None, 0.61), 1, 61.0),
        (Limits(), 5, 1.0),
    ],
)
def test_what_cells_may_take(limits, cells, seconds):
    assert limits.seconds(cells) == pytest.approx(seconds)


def test_limits_as_they_are_asked_for():
    assert limits_of(None) == Limits(None, 0.0)
    assert limits_of("2 min") == Limits(120.0, 0.0)


def processes(limits, good=None, dearest=0.0):
    made = object.__new__(Processes)
    made.limits, made.good, made.dearest, made.over, made._solvers, made.most_bytes = (
        limits,
        good,
        dearest,
        False,
        [],
        99,
    )
    made.grid = None
    return made


def test_cells_of_a_sample_have_ten_times_what_the_dearest_took():
    assert processes(Limits(60.0), None, 0.5).seconds(1) == 60.0  # none is known to end
    assert processes(Limits(60.0), 3, 0.5).seconds(1) == 1.0 + 10 * 0.5
    assert processes(Limits(60.0), 3, 0.5).seconds(4) == 1.0 + 10 * 0.5 * 4
    assert processes(Limits(3.0), 0, 0.5).seconds(4) == 3.0
    assert processes(Limits(60.0, 0.01), 3, 0.5).seconds(1) == 60.0


class Never:
    """A future that does not end, on a clock on which each look takes so long."""

    def __init__(self, monkeypatch, looks):
        self.now, self.looks, self.asked = 0.0, iter(looks), []
        monkeypatch.setattr(isolate, "wait", self.wait)
        monkeypatch.setattr(isolate, "time", SimpleNamespace(monotonic=lambda: self.now))

    def wait(self, futures, seconds):
        self.asked.append(seconds)
        self.now += next(self.looks)
        return SimpleNamespace(done=set())


def test_a_future_is_waited_for_until_its_seconds_are_over(monkeypatch):
    clock = Never(monkeypatch, [0.2, 0.2, 0.1])
    with pytest.raises(TimeoutError):
        awaited(Future(), 0.5)
    assert clock.asked == pytest.approx([0.2, 0.2, 0.1])


def test_while_the_machine_sleeps_a_look_counts_for_twice_its_time_at_most(monkeypatch):
    clock = Never(monkeypatch, [3600.0, 0.4, 0.3])
    with pytest.raises(TimeoutError):
        awaited(Future(), 1.0)
    assert clock.asked == pytest.approx([0.2, 0.2, 0.2])


def test_while_it_compiles_its_seconds_do_not_count_but_those_of_loading(monkeypatch):
    monkeypatch.setattr(isolate, "LOAD_SECONDS", 0.4)
    clock = Never(monkeypatch, [0.1, 0.25, 0.25])
    told = iter([False, True, True])
    with pytest.raises(TimeoutError):
        awaited(Future(), 10.0, lambda: next(told))
    assert len(clock.asked) == 3
    done = Future()
    done.set_result(7)
    monkeypatch.undo()
    assert awaited(done, 1.0) == 7


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (None, "its process died"),
        (-11, "its process died of SIGSEGV"),
        (0, "its process ended with 0"),
        (7, "its process ended with 7"),
    ],
)
def test_what_a_process_died_of(code, text):
    assert isolate._death(code) == text


@pytest.mark.parametrize(("cells", "times"), [(1, 3), (2, 1)])
def test_one_cell_alone_is_tried_three_times_and_several_once(monkeypatch, cells, times):
    solver, tried = IsolatedSolver(processes(Limits(5.0))), []

    def call(limit, *words):
        tried.append((limit, *words))
        raise Died(f"died {len(tried)}")

    monkeypatch.setattr(solver, "call", call)
    with pytest.raises(isolate.Unsolved, match=f"died {times}"):
        solver._asked(4, cells, None)
    assert tried == [(5.0 if cells == 1 else 1.0, isolate.isolated.solve, 4, cells, None)] * times


def answer(seconds=0.0, reason="", memory=0, cells=2):
    return SimpleNamespace(arrays={"status": np.zeros(cells)}, seconds=seconds, reason=reason, memory=memory)


def test_answers_tell_what_cells_cost_and_one_that_is_known_to_end():
    of_all = processes(Limits())
    solver = IsolatedSolver(of_all)
    for start, seconds in ((5, 3.0), (9, 1.0)):
        solver._taken(answer(seconds), start)
    assert (of_all.dearest, of_all.good, solver.clock()) == (1.5, 5, 4.0)


def test_a_process_with_too_much_memory_is_ended_and_one_without_any_left_is_tried_anew(monkeypatch):
    solver, ended = IsolatedSolver(processes(Limits())), []
    monkeypatch.setattr(solver, "end", lambda: ended.append(1))
    solver._taken(answer(memory=99), 0)
    assert ended == []
    solver._taken(answer(memory=100), 0)
    assert ended == [1]
    with pytest.raises(Died, match="MemoryError: 5"):
        solver._taken(answer(reason="MemoryError: 5"), 0)
    assert ended == [1, 1]
    solver._fresh = True
    with pytest.raises(isolate.Unsolved, match="MemoryError: 5") as fault:
        solver._taken(answer(reason="MemoryError: 5"), 0)
    assert not isinstance(fault.value, Died)


@pytest.mark.parametrize(
    ("name", "file", "path"),
    [
        ("mine:K", "/a/b/mine.py", ("/a/b",)),
        ("mine:K", "/a/b/mine/__init__.py", ("/a/b",)),
        ("my.own.one:K", "/a/b/my/own/one.py", ("/a/b",)),
        ("my.own:K", "/a/b/my/own/__init__.py", ("/a/b",)),
        ("mine", "/a/b/mine.py", ()),
        ("nowhere:K", None, ()),
    ],
)
def test_the_folder_that_a_kernel_is_imported_from(monkeypatch, name, file, path):
    if file is not None:
        monkeypatch.setitem(sys.modules, name.partition(":")[0], SimpleNamespace(__file__=file))
    assert kernel_paths(SimpleNamespace(kernel_name=name)) == path


class Pool:
    """An executor that gives nothing, or is slow to end."""

    def __init__(self, slow=False):
        self.told, self.slow = [], slow

    def submit(self, *words):
        self.told.append(words)

    def shutdown(self, cancel_futures):
        self.told.append(("shutdown", cancel_futures))
        time.sleep(0.3 * self.slow)


def with_pool(pool, code=-9):
    solver, killed = IsolatedSolver(processes(Limits())), []
    solver._pool, solver._process = pool, SimpleNamespace(kill=lambda: killed.append(1), exitcode=code)
    return solver, killed


def test_a_process_is_killed_and_its_executor_shut_down_once():
    pool = Pool()
    solver, killed = with_pool(pool, -11)
    assert solver._bury(5.0) == -11
    assert (killed, pool.told, solver._pool) == ([1], [("shutdown", True)], None)
    assert solver._bury(5.0) is None
    assert killed == [1]
    solver._pool, solver._process = Pool(), None
    assert solver._bury(5.0) is None
    slow, _ = with_pool(Pool(slow=True))
    assert slow._bury(0.0) is None  # nobody waits for its status


@pytest.mark.parametrize(
    ("fault", "code", "kind", "said"),
    [
        (TimeoutError(), None, isolate.Unsolved, "took longer than 4.5 s"),
        (TimeoutError(), -9, isolate.Unsolved, "took longer than 4.5 s"),
        (TimeoutError(), -11, Died, "its process died of SIGSEGV"),
        (RuntimeError(), -9, Died, "its process died of SIGKILL"),
        (isolate.CancelledError(), None, Died, "its process died"),
    ],
)
def test_a_process_that_gives_nothing_was_late_or_died(monkeypatch, fault, code, kind, said):
    solver, _ = with_pool(Pool(), code)
    if code is None:
        solver._process = None

    def awaited(*words):
        raise fault

    monkeypatch.setattr(isolate, "awaited", awaited)
    with pytest.raises(isolate.Unsolved) as found:
        solver.call(4.5, len, "x")
    assert (type(found.value), str(found.value)) == (kind, said)


def test_while_a_run_is_stopped_nothing_is_said_of_cells(monkeypatch):
    solver, _ = with_pool(Pool())

    def awaited(*words):
        solver._all.over = True
        raise TimeoutError

    monkeypatch.setattr(isolate, "awaited", awaited)
    with pytest.raises(isolate.Ended, match="the run is being stopped"):
        solver.call(4.5, len, "x")
    with pytest.raises(isolate.Ended, match="the run is being stopped"):
        solver._begun()


def test_processes_have_half_of_the_memory_between_them(monkeypatch):
    monkeypatch.setattr(isolate, "memory", lambda: 1000)
    made = Processes(tall(3), Limits(2.0), 4)
    assert (made.most_bytes, made.good, made.dearest, made.over) == (125.0, None, 0.0, False)
    solver = made.solver()
    assert made._solvers == [solver]
    assert solver.clock() == 0.0
    ended = []
    monkeypatch.setattr(solver, "end", lambda: ended.append(1))
    made.end()
    assert (ended, made.over) == ([1], True)


@pytest.mark.parametrize("bounds", [True, False])
def test_what_a_process_answers_is_put_in_its_place(monkeypatch, bounds):
    solver, asked = IsolatedSolver(processes(Limits())), []
    column = np.arange(2.0)
    found = {"fall_time": column, "status": column + 1, "method_used": column + 2, "error_bound": column + 3}
    monkeypatch.setattr(solver, "_asked", lambda *words: (asked.append(words), found)[1])
    error = np.zeros(2, np.float32) if bounds else None
    cells = isolate.Cells({"fall_time": np.zeros(2)}, np.zeros(2, np.int8), np.zeros(2, np.int8), error)
    solver.solve(7, cells, "wanted")
    assert asked == [(7, 2, "wanted")]
    assert (cells.outputs["fall_time"].tolist(), cells.status.tolist(), cells.used.tolist()) == ([0, 1], [1, 2], [2, 3])
    assert not bounds or error.tolist() == [3, 4]


def test_a_call_is_awaited_while_its_process_compiles(monkeypatch):
    solver, _ = with_pool(Pool())
    solver._compiling, told = SimpleNamespace(value=0), []
    monkeypatch.setattr(isolate, "awaited", lambda future, seconds, compiling: (told.append(compiling), seconds)[1])
    assert solver.call(4.5, len, "x") == 4.5
    assert solver._pool.told == [(len, "x")]
    assert told[0]() is False
    solver._compiling.value = 1
    assert told[0]() is True


@pytest.mark.parametrize("compiler", [True, False])
def test_processes_are_made_of_a_clean_one_that_has_the_compiler_if_this_one_has(monkeypatch, compiler):
    preloaded = []
    context = SimpleNamespace(set_forkserver_preload=preloaded.append)
    monkeypatch.setattr(isolate.multiprocessing, "get_context", {"forkserver": context}.get)
    monkeypatch.setattr(isolate, "sys", SimpleNamespace(modules={"numba": 1} if compiler else {}))
    assert isolate._context() is context
    assert preloaded == [["sweep.runs.isolated", "numba"] if compiler else ["sweep.runs.isolated"]]


@pytest.mark.parametrize("before", [{}, {"daemon": True}, {"daemon": False}])
def test_a_process_is_made_apart_from_this_program(monkeypatch, before):
    flags, main = {"semprefix": "x", **before}, sys.modules["__main__"]
    monkeypatch.setattr(isolate.multiprocessing, "current_process", lambda: SimpleNamespace(_config=flags))
    made = []
    with isolate._apart():
        made.append((dict(flags), vars(sys.modules["__main__"]).keys()))
    assert made == [({"semprefix": "x"}, vars(ModuleType("__main__")).keys())]
    assert flags == {"semprefix": "x", **before}
    assert sys.modules["__main__"] is main
    assert not isolate._starting.locked()


def test_a_process_is_begun_with_its_flag(monkeypatch):
    made = []

    class Executor(Pool):
        def __init__(self, *words):
            super().__init__()
            made.append(words)

    context = SimpleNamespace(RawValue=lambda kind: ("flag", kind))
    monkeypatch.setattr(isolate, "_context", lambda: context)
    monkeypatch.setattr(isolate, "ProcessPoolExecutor", Executor)
    solver = IsolatedSolver(processes(Limits()))
    solver._process = "old"
    pool = solver._begun()
    assert made == [(1, context, isolate.isolated.enter, (("flag", "i"),))]
    assert (solver._pool, solver._process, solver._compiling) == (pool, None, ("flag", "i"))
    assert pool.told == [(int,)]
