"""A study as TOML and as JSON, and back: exactly, and readable without its kernel; what a study may be given as."""

import json
import math
import tomllib

import numpy as np
import pytest
import toy
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_studies import build, build_rich

import sweep
from sweep.study.model import Study

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, min_value=1e-300, max_value=1e300)
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)


@st.composite
def spaced(draw, **more):
    start = draw(st.floats(1e-3, 1e3))
    entry = {"spacing": draw(st.sampled_from(["linear", "log"])), "start": start, **more}
    return entry | {"stop": start * draw(st.floats(1.001, 1e3)), "unit": draw(st.sampled_from(["m", "cm", "km"]))}


@st.composite
def layouts(draw):
    """Keys that say which axes there are, and how they make a grid."""
    values = draw(st.lists(NUMBERS, min_size=1, max_size=5, unique=True))
    listed = st.sampled_from([values, np.array(values), {"values": values, "unit": "mm"}])
    speeds = draw(st.lists(st.floats(0.0, 1e9), min_size=1, max_size=4, unique=True))
    design = {"kind": draw(st.sampled_from(["sobol", "latin"])), "n": 4, "seed": draw(st.integers(0, 2**32 - 1))}
    block = {"design": design | {"scramble": draw(st.booleans())}, "axes": {"height": draw(spaced())}}
    any_float = draw(st.lists(st.floats(), min_size=1, max_size=5, unique_by=repr))
    height = draw(st.one_of(listed, spaced(num=draw(st.integers(2, 9)))))
    return draw(
        st.sampled_from(
            [
                {"axes": {"height": height, "v0": speeds}},
                {"design": "zip", "axes": {"height": any_float}},  # NaN, infinities and -0 too
                block,
                {"blocks": [block, {"axes": {"v0": speeds}}]},
            ]
        )
    )


@st.composite
def settings_of(draw):
    keys = {"title": draw(TEXTS), "question": draw(TEXTS), "rtol": draw(st.floats(1e-15, 0.99))}
    summary = {"outputs": {"fall_time": ["min", "histogram"]}, "edges": {"fall_time": [0.1, 1.0]}}
    for more in (
        [{}, {"method": "exact"}, {"where": "height > '3 cm'"}, {"fixed": {"g": draw(st.floats(0, exclude_min=True))}}],
        [{}, {"outputs": ["drop"], "along": {"phase": {"num": 3}}}, {"summary": summary}],
    ):
        keys |= draw(st.sampled_from(more))
    return keys


def same(study, again):
    """Studies are equal whose JSON is, so what that leaves out is asked for as well."""
    assert again == study
    assert hash(again) == hash(study)
    assert again.dims == study.dims
    for name, value in vars(study).items():
        if name not in ("kernel", "text"):
            assert repr(getattr(again, name)) == repr(value), name
    for name, axis in study.axes.items():
        assert again.axes[name].values.tobytes() == axis.values.tobytes()


@settings(deadline=None, max_examples=200)
@given(layout=layouts(), keys=settings_of())
def test_a_study_comes_back_exactly(layout, keys):
    study = build(**layout, **keys)
    again = sweep.study(tomllib.loads(sweep.to_toml(study)), allow_import=True)
    same(study, again)
    assert sweep.to_toml(again) == sweep.to_toml(study)
    same(study, Study.from_json(study.to_json(), allow_import=True))


def test_what_follows_another_parameter_is_written_where_it_differs_alone():
    """An axis of R may then be added to the text."""
    for stiction, written in (({}, False), ({"R_s": 0.3}, False), ({"R_s": 0.5}, True)):
        fixed = {"a": 1.0, "phi0": 1.0, "R": 0.3, **stiction}
        study = sweep.study(kernel="foliot", axes={"mu": [1.0]}, fixed=fixed)
        assert ("R_s" in sweep.to_toml(study)) is written
        same(study, sweep.study(tomllib.loads(sweep.to_toml(study))))


@pytest.mark.parametrize("length", [3, 5000])
def test_arrays_come_back_exactly_and_json_of_long_ones_is_short(length):
    values = np.random.default_rng(1).standard_normal(length)
    values[1] = math.nan
    rows = {"kernel": "beads:KERNEL", "allow_import": True}
    mass = abs(np.nan_to_num(values)) + 1.0
    for study in (
        build(axes={"height": values}, fixed={"v0": -0.0}),
        sweep.study(**rows, fixed={"mass": mass}, axes={"g": [1.0]}),
        sweep.study(**rows, axes={"mass": [mass.tolist(), (2 * mass).tolist()]}, design="zip"),
    ):
        text = study.to_json()
        json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
        assert len(text) < 16 * 3 * length + 4000  # bytes, which are read twenty times as fast
        again = Study.from_json(text, allow_import=True)
        same(study, again)
        same(study, sweep.study(tomllib.loads(sweep.to_toml(study)), allow_import=True))
        declared = [again, Study.from_json(text, declared=True)]
        assert len({repr([(m.name, m.excludes, m.lacks) for m in s.kernel.methods]) for s in (study, *declared)}) == 1
        assert again.lengths == study.lengths == Study.from_json(text, declared=True).lengths


def test_json_suffices_to_read_a_study_whose_kernel_is_gone():
    toy.GONE = toy.RICH
    keys = {"kernel": "toy:GONE", "fixed": {"shape": "square"}, "axes": {"load": [1.0], "method": ["auto", "slow"]}}
    text = build_rich(**keys).to_json()
    del toy.GONE
    study = Study.from_json(text, declared=True)
    assert [p.name for p in study.kernel.parameters] == ["load", "shape", "drag", "grip", "hold"]
    assert (study.kernel.parameter("load").upper, study.kernel.parameter("grip").default) == (math.inf, "load")
    assert study.kernel.methods[0].excludes == ("drag", "grip")
    assert (study.axes["method"].words, study.to_json()) == (("auto", "slow"), text)
    for action, message in (
        (lambda: study.kernel.check(), "without its kernel"),
        (lambda: Study.from_json(text), "allow it with --allow-import"),
        (lambda: Study.from_json(text, allow_import=True), "cannot be loaded"),
    ):
        with pytest.raises(sweep.SweepError, match=message):
            action()


@pytest.mark.parametrize("text", ["", "{}", "[]", "null", '{"format": 2}', '{"format": 2, "axes": [{}]}', "\x00"])
def test_other_json_is_refused(text):
    with pytest.raises(sweep.SweepError, match="not the JSON"):
        Study.from_json(text)
