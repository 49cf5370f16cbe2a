"""What stands at an output's place before a run, and what is done with it."""

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest
from running import tall
from toy_studies import build

from sweep.cells.output_schema import part_columns
from sweep.runs import resume
from sweep.runs.resume import EXTENDABLE, is_complete, take_up, tidy
from sweep.runs.run import _task
from sweep.system.errors import SweepError

SAME = {"axes.height": "1", "design": "product", "rtol": "1e-06"}
MORE = {**SAME, "axes.height": "0"}
OTHER = {**SAME, "rtol": "1e-03"}


@pytest.fixture
def output(tmp_path):
    path = tmp_path / "out.h5"
    path.write_text("there")
    return path


def task_of(output, **changed):
    keys = {"output": output, "study": tall(10), "fingerprint": SAME, "notes": []}
    keys |= dict.fromkeys(("force", "repair", "extend", "retry_failed"), False)
    found = SimpleNamespace(**keys | changed)
    found.note = found.notes.append
    return found


@pytest.fixture
def stands(monkeypatch):
    """A result of this fingerprint stands there, damaged or not, and cells of it FAILED or did not."""

    def put(stored=SAME, damaged=None, failed=False):
        looked = []
        monkeypatch.setattr(resume, "stored_fingerprint", lambda path: stored)
        monkeypatch.setattr(resume, "verify", lambda path: SimpleNamespace(blocks=damaged))
        monkeypatch.setattr(resume, "check_whole", looked.append)
        monkeypatch.setattr(resume, "has_failed", lambda path: failed)
        return looked

    return put


def test_where_nothing_stands_nothing_is_complete(tmp_path):
    assert is_complete(task_of(tmp_path / "none.h5")) is False


@pytest.mark.parametrize(
    ("asked", "stood", "complete", "looked_at"),
    [
        ({}, {}, True, 1),
        ({"force": True}, {}, False, 0),
        ({"force": True}, {"stored": OTHER}, False, 0),
        ({}, {"damaged": [2]}, True, 1),  # which `check_whole` tells
        ({"repair": True}, {"damaged": [2]}, False, 0),
        ({"repair": True}, {"damaged": []}, False, 0),  # beside its numbers
        ({"repair": True}, {}, True, 1),
        ({}, {"failed": True}, True, 1),
        ({"retry_failed": True}, {"failed": True}, False, 1),
        ({"retry_failed": True}, {}, True, 1),
        ({"extend": True}, {}, True, 1),
        ({"extend": True}, {"stored": MORE}, False, 0),
    ],
)
def test_a_result_of_the_study_is_complete_unless_more_is_asked_of_it(
    output, stands, asked, stood, complete, looked_at
):
    looked = stands(**stood)
    assert is_complete(task_of(output, **asked)) is complete
    assert looked == [output] * looked_at


CURE = "choose another name, or overwrite it with --force"


@pytest.mark.parametrize(
    ("extend", "stored", "said", "listed"),
    [
        (False, MORE, f"holds the result of another study or version; {CURE}; {EXTENDABLE}", "axes.height"),
        (False, OTHER, f"holds the result of another study or version; {CURE}", "rtol"),
        (True, OTHER, f"cannot be extended, for rtol differs, too; {CURE}", "rtol"),
    ],
)
def test_the_result_of_another_study_is_told_with_what_differs(output, stands, extend, stored, said, listed):
    stands(stored)
    with pytest.raises(SweepError) as fault:
        is_complete(task_of(output, extend=extend))
    first, second = str(fault.value).split("\n")
    assert first == f"{output}: {said}"
    assert second.startswith(f"  {listed}")


class Kept:
    """A store in which an earlier run left something."""

    def __init__(self, layout=None, fault=None):
        self.layout, self.fault, self.done, self.path = layout, fault, [], "out.h5.unfinished"

    def found(self):
        if self.fault:
            raise self.fault
        return self.layout

    def discard(self):
        self.done.append("discard")

    def resume(self, layout):
        self.done.append(("resume", layout))

    def reopen(self, blocks):
        self.done.append(("reopen", blocks))


def left(fingerprint=SAME, rows=10, columns=None):
    """What an earlier run of ten cells left."""
    columns = columns or [(c.name, c.cell_bytes) for c in part_columns(tall(10))]
    places = [SimpleNamespace(name=name, cell_bytes=size) for name, size in columns]
    work = SimpleNamespace(places=places, blocks=SimpleNamespace(size=rows))
    return SimpleNamespace(fingerprint=fingerprint, work=work)


def test_what_was_left_is_continued(output):
    store = Kept(left())
    take_up(store, task_of(output))
    assert store.done == [("resume", store.layout)]


def test_where_nothing_was_left_the_run_begins_anew(output):
    store = Kept()
    take_up(store, task_of(output))
    assert store.done == ["discard"]


@pytest.mark.parametrize(
    ("keys", "done"),
    [
        ({}, [("reopen", [3])]),
        ({"force": True}, ["discard"]),
        ({"repair": False}, ["discard"]),
        ({"damaged": None}, [("reopen", ())]),
        ({"output": "none"}, ["discard"]),
    ],
)
def test_a_damaged_result_is_reopened_where_that_is_asked_for(output, stands, keys, done):
    stands(damaged=keys.pop("damaged", [3]))
    store = Kept()
    place = output.with_name(keys.pop("output", output.name))
    take_up(store, task_of(place, **{"repair": True, **keys}))
    assert store.done == done
    store = Kept(left())
    take_up(store, task_of(place, repair=True))
    assert store.done == [("resume", store.layout)]


def test_what_another_study_left_is_kept_unless_forced(output):
    store = Kept(left(OTHER))
    said = re.escape(
        "out.h5.unfinished: the unfinished result of another study or version; finish that one first, choose another "
        "name, or give it up with --force\n  rtol"
    )
    with pytest.raises(SweepError, match=f"^{said}"):
        take_up(store, task_of(output))
    assert store.done == []
    take_up(store, task_of(output, force=True))
    assert store.done == ["discard"]


@pytest.mark.parametrize("wrong", [{"rows": 11}, {"columns": [("fall_time", 8)]}])
def test_what_does_not_fit_its_study_is_kept_unless_forced(output, wrong):
    store = Kept(left(**wrong))
    with pytest.raises(SweepError) as fault:
        take_up(store, task_of(output))
    assert str(fault.value) == (f"{output}: its unfinished result is not what its study makes; give it up with --force")
    assert store.done == []
    take_up(store, task_of(output, force=True))
    assert store.done == ["discard"]


def test_what_is_damaged_beside_its_numbers_is_given_up_only_when_forced(output):
    store = Kept(fault=SweepError("damaged"))
    with pytest.raises(SweepError, match=r"^damaged$"):
        take_up(store, task_of(output))
    take_up(store, task_of(output, force=True))
    assert store.done == ["discard"]


@pytest.mark.parametrize(("layout", "done"), [(left(), ["discard"]), (left(OTHER), []), (None, [])])
def test_what_is_left_beside_a_complete_output_is_removed_if_it_is_of_its_study(output, layout, done):
    store = Kept(layout)
    tidy(store, task_of(output))
    assert store.done == done


def test_what_a_run_is_called_and_where_it_writes(output):
    study = build(axes={"height": [1.0]}, title="Stones")
    assert _task(study, output, workers=3).name == "out.h5"
    assert (_task(study, output, workers=3).workers, _task(study, output).output) == (3, output)
    assert _task(study, None).name == "Stones"
    assert _task(replace(study, title=""), None).name == "sweep"
    with pytest.raises(AssertionError, match="a run in memory has no output"):
        _ = _task(study, None).output
