"""One key of a valid study changed at a time: the mistake stands at that key, and nothing else is said.

Studies that together use every key are changed key by key (left out, misspelt, of a wrong type, out of limits, in a
wrong unit), as dicts and as TOML, and by several keys at once.
"""

import copy
import datetime
import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sweep

TOY = {"kernel": "toy:KERNEL", "outputs": ["fall_time"]}
LOG = {"spacing": "log", "start": 1, "stop": 1e3, "num": 31, "unit": "cm"}
RANGE = {"spacing": "linear", "start": 2.0, "stop": 5.0}
MASS = [0.1, 0.2, 0.7]

STUDIES = {
    "product": {
        "title": "Stones", "question": "How fast?", "kernel": "toy:KERNEL", "method": "exact", "rtol": 1e-15,
        "outputs": ["fall_time", "drop"], "design": "product", "where": "height > '3 cm' and v0**2 < g*height",
        "axes": {"height": LOG, "v0": {"spacing": "linear", "start": 0, "stop": 2, "num": 5, "unit": "km/hour"}},
        "fixed": {"g": {"value": 981, "unit": "cm/s^2"}}, "along": {"phase": {"num": 3}},
    },
    "zip": {
        **TOY, "design": "zip", "fixed": {"g": 1.62},
        "axes": {
            "height": {"file": "points.csv", "unit": "mm"}, "v0": {"values": [0.0, 1.0], "unit": "mm/s"},
            "method": ["exact", "auto"], "rtol": [1e-3, 1e-6],
        },
    },
    "coordinates": {
        **TOY, "outputs": ["drop"], "axes": {"height": [1.0, 2.0], "g": {"values": [1.0], "unit": "m/s^2"}},
        "fixed": {"v0": 0.5},
        "along": {"phase": {"spacing": "linear", "start": 0.0, "stop": 100.0, "num": 3, "unit": "percent"}},
    },
    "sobol": {
        **TOY, "design": {"kind": "sobol", "n": 8, "seed": 2**32 - 1, "scramble": False},
        "axes": {"height": {**RANGE, "unit": "m"}, "v0": RANGE},
    },
    "blocks": {
        **TOY, "method": "rough", "blocks": [
            {"design": {"kind": "latin", "n": 4}, "axes": {"height": {**RANGE, "spacing": "log"}}},
            {"design": "zip", "axes": {"v0": {"file": "points.csv", "unit": "mm/s"}}},
            {"design": "product", "axes": {"g": {"spacing": "log", "start": 1, "stop": 10.0, "num": 3}}},
        ],
    },
    "summary": {
        **TOY, "axes": {"height": LOG, "v0": [0.0, 1.0]},
        "summary": {
            "over": ["height"], "outputs": {"fall_time": ["min", "histogram"]},
            "edges": {"fall_time": {"spacing": "log", "start": 1, "stop": 1e3, "num": 31, "unit": "ms"}},
        },
    },
    "arrays": {
        "kernel": "beads:KERNEL", "method": "whole", "axes": {"g": [1.0, 2.0]},
        "fixed": {"mass": {"value": MASS, "unit": "g"}, "place": {"file": "rod.csv", "unit": "mm"}},
    },
    "rows": {
        "kernel": "beads:KERNEL", "design": "zip", "fixed": {"place": [0.5, 1.0], "g": 1.0},
        "axes": {"mass": {"values": [[1.0, 2.0], [3.0, 4.0]], "unit": "g"}, "rtol": [1e-3, 1e-4]},
    },
    "words": {
        "kernel": "toy:RICH", "method": "slow", "axes": {"load": [1.0, 2.0], "shape": ["round", "square"]},
        "fixed": {"grip": {"value": 2.0, "unit": "mN"}, "drag": 0.5},
    },
    "a word": {"kernel": "toy:RICH", "axes": {"load": [1.0, 2.0]}, "fixed": {"shape": "square"}},
    "whole numbers": {
        "kernel": "foliot_steps", "outputs": ["period"], "axes": {"mu": [1.0]},
        "fixed": {"a": 1.0, "phi0": 1.0, "step": 0.1, "flips": 4},
    },
}  # fmt: skip

NEEDED = {"kernel", "spacing", "start", "stop", "num", "values", "file", "value", "kind", "n", "edges"}
"""Keys without which an entry or a study is none; all others have a default."""
NEEDED_NAMES = {"fixed.phi0", "fixed.step", "fixed.mass", "along.phase", "summary.edges.fall_time"}
WORDS = {"method", "design", "kind", "spacing", "outputs", "over", "kernel", "shape", "fall_time"}
"""Keys whose texts are of a short list."""
BEYOND = {
    "rtol": [1.0, 1e-16, math.nan, -1e-3], "num": [1, -3, 10_000_001], "n": [1, 10_000_001], "seed": [-1, 2**32],
    "g": [0.0, -1.0, math.nan], "v0": [-0.5], "flips": [0, 2.5, 1e300], "phi0": [-1.0],
}  # fmt: skip
"""Values that a key may not have."""
FIXED = {"g", "v0", "flips", "phi0"}
"""Of these under `fixed` only: an axis may leave the limits, which refuses its cells."""
DATE = datetime.date(1979, 5, 27)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("studies")
    (found / "points.csv").write_text("height,v0\n1,0\n2.5,1\n")
    (found / "rod.csv").write_text("mass,place\n1,1\n2,2\n3,3\n")
    return found


def text(value):
    """A value in TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {text(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(text, value))}]"
    return json.dumps(value) if isinstance(value, str) else str(value).lower()


def mistakes_in(study):
    """{where: message} of what is said of a study; one message a place."""
    try:
        sweep.study(study, allow_import=True)
    except sweep.StudyError as error:
        found = error.mistakes
    else:
        return {}
    told = {m.where: m.message for m in found}
    assert len(told) == len(found), found
    return told


def told(keys, folder):
    """{where: message} of what is said of the keys; the same of a dict and of a file."""
    (folder / "study.toml").write_text("".join(f"{key} = {text(value)}\n" for key, value in keys.items()))
    found = [mistakes_in(keys), mistakes_in(folder / "study.toml")]
    assert found[0].keys() == found[1].keys()
    return found[0]


def places(value, path=()):
    """Paths of all tables, lists and values of a study, the study itself left out."""
    for key, item in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield (*path, key), item
        yield from places(item, (*path, key))


def named(path):
    """`axes.mu.values[2]`"""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path).removeprefix(".")


def misspelt(word):
    """A word with two letters swapped or one more in it."""
    swapped = word[:-3] + word[-2] + word[-3] + word[-1] if len(word) > 3 else word
    return swapped if swapped != word else word[:1] + "_" + word[1:] if len(word) > 1 else word + "_"


def key_of(path):
    """The last name in a path."""
    return next(key for key in reversed(path) if isinstance(key, str))


def mutations(study):
    """Every change of a valid study: its path, what is done there, where that is told, and the word that is offered."""
    for path, value in places(study):
        *above, key = path
        where, name = named(path), key_of(path)
        if isinstance(key, str):
            yield path, ("name", misspelt(key)), [named((*above, misspelt(key)))], key
            if (key in NEEDED and not (key == "edges" and above)) or where in NEEDED_NAMES:
                yield path, ("drop",), [where, named(above), named((*above, "value"))], None
        for wrong in wrong_types(path, value):
            yield path, ("put", wrong), [where, *([named(above)] if isinstance(value, list) else [])], None
        if not isinstance(value, dict | list):
            for beyond in BEYOND.get(name, ()) if path[0] == "fixed" or name not in FIXED else ():
                yield path, ("put", beyond), [where, named(above)], None
            if name in ("start", "stop") and study_at(study, above)["spacing"] == "log":
                yield path, ("put", 0), [where], None
            if isinstance(value, str) and ":" not in value and (name in WORDS or path[:2] == ("axes", "method")):
                yield path, ("put", misspelt(value)), [where], value
            if name == "unit":
                yield path, ("put", "kg m/s"), [where], None
                yield path, ("put", "3 ;"), [where], None
                yield path, ("put", "minuet"), [where], "minute"
            if name == "file":
                yield path, ("put", "points.cvs"), [where], None


def wrong_types(path, value):
    """What is no value of that kind."""
    if isinstance(value, bool):
        return [1, "true", DATE]
    if isinstance(value, dict):
        return [] if path[0] == "fixed" and len(path) == 2 else [True, DATE]
    if isinstance(value, list):
        return [True, DATE, "5"]
    return [True, DATE, ["a"] if isinstance(value, str) else "5e-3"]


def study_at(study, path):
    for key in path:
        study = study[key]
    return study


def changed(study, path, change):
    """The study with one change, itself untouched."""
    study = copy.deepcopy(study)
    *above, key = path
    table = study_at(study, above)
    match change:
        case ("put", value):
            table[key] = value
        case ("drop",):
            del table[key]
        case ("name", name):
            items = [(name if k == key else k, v) for k, v in table.items()]
            table.clear()
            table.update(items)
    return study


@pytest.fixture(autouse=True)
def _here(folder, monkeypatch):
    monkeypatch.chdir(folder)


@pytest.mark.parametrize("name", STUDIES)
def test_one_mistake_is_told_at_its_key_with_the_word_that_was_meant(folder, name):
    study = STUDIES[name]
    assert told(study, folder) == {}
    wrong = []
    for path, change, allowed, offered in mutations(study):
        found = told(changed(study, path, change), folder)
        hint = f"did you mean {offered}?" if offered else ""
        if not (len(found) == 1 and set(found) <= set(allowed) and hint in str(found)):
            wrong.append((named(path), change, found))
    assert not wrong, "\n".join(map(str, wrong))


EACH = {name: list(mutations(study)) for name, study in STUDIES.items()}


def entry(path):
    """What of a study a change belongs to: of all that says how others are read, one alone."""
    return path[:2] if path[0] in ("axes", "fixed") else path[:1] if path[0] in APART else "the rest"


APART = ("title", "question", "method", "rtol", "where")


@settings(max_examples=150)
@given(data=st.data())
def test_of_several_mistakes_each_is_told_and_no_more(folder, data):
    """In different entries: within one a mistake may stand in the way of another (a log axis from 0, no spacing)."""
    name = data.draw(st.sampled_from(sorted(STUDIES)))
    inner = [m for m in EACH[name] if m[0] not in (("axes",), ("fixed",), ("kernel",)) and m[0][0] != "design"]
    chosen = data.draw(st.lists(st.sampled_from(inner), min_size=2, max_size=4, unique_by=lambda m: entry(m[0])))
    study = STUDIES[name]
    for path, change, *_ in chosen:
        study = changed(study, path, change)
    found = told(study, folder)
    assert len(found) == len(chosen), (chosen, found)
    assert all(set(found) & set(allowed) for *_, allowed, _ in chosen), (chosen, found)
