"""A study as TOML and back, exactly."""

import re
import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_studies import build, build_rich

import sweep
from sweep.study.model import Study

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, min_value=1e-300, max_value=1e300)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@st.composite
def spaced(draw, more=()):
    start = draw(st.floats(1e-3, 1e3))
    stop = start * draw(st.floats(1.001, 1e3))
    entry = {"spacing": draw(st.sampled_from(["linear", "log"])), "start": start, "stop": stop, **dict(more)}
    return entry | draw(st.sampled_from([{}, {"unit": "cm"}, {"unit": "km"}]))


@st.composite
def heights(draw):
    values = draw(st.lists(NUMBERS, min_size=1, max_size=5, unique=True))
    listed = st.sampled_from([values, np.array(values), {"values": values, "unit": "mm"}])
    return draw(st.one_of(listed, spaced(more={"num": draw(st.integers(2, 9))}.items())))


@st.composite
def layouts(draw):
    """Keys that say which axes there are, and how they make a grid."""
    speeds = draw(st.lists(st.floats(0.0, 1e9), min_size=1, max_size=4, unique=True))
    kind = draw(st.sampled_from(["product", "zip", "sampled", "blocks"]))
    if kind == "product":
        return {"axes": {"height": draw(heights()), "v0": speeds}}
    if kind == "zip":
        return {"design": "zip", "axes": {"height": [v + 1.0 for v in speeds], "v0": speeds}}
    design = {"kind": draw(st.sampled_from(["sobol", "latin"])), "n": 4, "seed": draw(st.integers(0, 2**32 - 1))}
    design |= {"scramble": draw(st.booleans())}
    block = {"design": design, "axes": {"height": draw(spaced())}}
    return block if kind == "sampled" else {"blocks": [block, {"axes": {"v0": speeds}}]}


@st.composite
def settings_of(draw):
    keys = {"title": draw(TEXTS), "question": draw(TEXTS), "rtol": draw(st.floats(1e-15, 0.99))}
    keys |= draw(st.sampled_from([{}, {"method": "exact"}, {"where": "height > '3 cm'"}, {"fixed": {"g": 1.62}}]))
    keys |= draw(st.sampled_from([{}, {"outputs": ["drop"], "along": {"phase": {"num": 3}}}]))
    return keys | draw(
        st.sampled_from(
            [{}, {"summary": {"outputs": {"fall_time": ["min", "histogram"]}, "edges": {"fall_time": [0.1, 1.0]}}}]
        )
    )


@settings(deadline=None, max_examples=200)
@given(layout=layouts(), keys=settings_of())
def test_a_study_comes_back_exactly(layout, keys):
    if "summary" in keys:
        keys.pop("outputs", None)
    study = build(**layout, **keys)
    again = sweep.study(tomllib.loads(sweep.to_toml(study)), allow_import=True)
    assert again == study
    assert sweep.to_toml(again) == sweep.to_toml(study)
    assert Study.from_json(study.to_json(), allow_import=True) == study


def test_words_and_arrays_come_back(tmp_path):
    chain = {"kernel": "drivetrain", "outputs": ["frequency"]}
    studies = [
        build_rich(),
        sweep.study(**chain, axes={"reduction": ["rivin", "exact"]}, fixed={"J": [1.0, 2.0], "k": 3.0, "n_keep": 1}),
        sweep.study(
            **chain,
            design="zip",
            axes={"J": [[1.0, 2.0]], "k": [[1.0, 2.0]]},
            fixed={"reduction": "modal", "n_keep": 1},
        ),
        build(axes={"height": [1.0], "method": ["exact", "auto"]}),
        build(axes={"height": [1.0], "rtol": [1e-3, 1e-6]}),
    ]
    for study in studies:
        path = tmp_path / "again.toml"
        path.write_text(sweep.to_toml(study), encoding="utf-8")
        again = sweep.study(path, allow_import=True)
        assert sweep.study(tomllib.loads(again.text), allow_import=True) == study


def test_what_a_study_may_be_given_as(tmp_path):
    keys = {"kernel": "toy:KERNEL", "outputs": ["fall_time"], "axes": {"height": [1.0, 2.0]}}
    path = tmp_path / "s.toml"
    path.write_text(sweep.to_toml(build(**keys)))
    results = [
        sweep.run(build(**keys)),
        sweep.run(path, allow_import=True),
        sweep.run(str(path), allow_import=True),
        sweep.run(keys, allow_import=True),
        sweep.run(**keys, allow_import=True),
    ]
    for found in results:
        assert found.fall_time.values.tobytes() == results[0].fall_time.values.tobytes()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sweep.run(), "give one, the path of its TOML file, a dict of its keys, or keywords"),
        (lambda: sweep.run(3), "expected a study, its path, or a dict of its keys, found 3; or write keywords"),
        (lambda: sweep.run(kernel="foliot", workes=2), "sweep.run: no such keyword workes; did you mean workers?"),
        (lambda: sweep.run(build(axes={"height": [1.0]}), rtol=1e-3), "rtol: keywords do not go with a study"),
        (lambda: sweep.run("a.h5"), "a.h5 is a result, not a study"),
        (lambda: sweep.run("a.py"), "run it with: python a.py"),
        (lambda: sweep.run("nowhere.toml"), "nowhere.toml: no such file"),
        (lambda: sweep.study(kernel="foliot"), "study: 3 mistakes"),
    ],
)
def test_errors_name_the_way(call, message):
    with pytest.raises(sweep.SweepError) as caught:
        call()
    assert message in str(caught.value)


def test_a_zero_below_nothing_is_written_where_the_default_is_zero():
    study = build(axes={"height": [1.0]}, fixed={"v0": -0.0})
    again = sweep.study(tomllib.loads(sweep.to_toml(study)), allow_import=True)
    assert np.signbit(again.fixed["v0"])
    assert again == study


def test_only_a_study_is_written():
    said = "sweep.to_toml: expected a Study, found a dict; sweep.study gives one"
    with pytest.raises(sweep.SweepError, match=f"^{re.escape(said)}$"):
        sweep.to_toml({})
