"""A study through JSON: exact, and readable without its kernel."""

import dataclasses
import json
import math

import numpy as np
import pytest
import toy
from hypothesis import given
from hypothesis import strategies as st
from toy_studies import HEAD, build, build_rich

import sweep
from sweep.study.model import Study


@given(st.lists(st.floats(), min_size=1, max_size=5, unique_by=repr), st.floats(0, exclude_min=True))
def test_every_float_gets_through_toml_python_and_json_unchanged(tmp_path_factory, values, fixed):
    axis = ", ".join(map(repr, values))
    path = tmp_path_factory.mktemp("study") / "s.toml"
    path.write_text(f'{HEAD}design = "zip"\naxes.height = [{axis}]\nfixed.g = {fixed!r}\n')
    toml = sweep.study(path, allow_import=True)
    python = build(axes={"height": values}, fixed={"g": fixed}, design="zip")
    again = Study.from_json(toml.to_json(), allow_import=True)
    assert dataclasses.replace(toml, text="") == python
    expected = np.array(values)
    for study in (toml, python, again):
        np.testing.assert_array_equal(study.axes["height"].values, expected)
        np.testing.assert_array_equal(
            np.signbit(study.axes["height"].values[expected == 0]), np.signbit(expected[expected == 0])
        )
        assert repr(study.fixed["g"]) == repr(fixed)


@pytest.mark.parametrize("length", [3, 1000, 1001, 5000])
def test_json_holds_long_arrays_exactly_too(length):
    values = np.random.default_rng(1).standard_normal(length)
    values[1] = math.nan
    study = build(axes={"height": values})
    text = study.to_json()
    json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert length <= 1000 or len(text) < 11 * length + 4000  # base64, which is read twenty times as fast
    again = Study.from_json(text, allow_import=True)
    assert again.axes["height"].values.tobytes() == study.axes["height"].values.tobytes()
    assert again == study
    assert hash(again) == hash(study)


def test_json_suffices_to_read_a_study_whose_kernel_is_gone(monkeypatch):
    text = build_rich(fixed={"shape": "square"}, axes={"load": [1.0], "method": ["auto", "slow"]}).to_json()
    monkeypatch.delattr(toy, "RICH")
    study = Study.from_json(text, declared=True)
    assert [p.name for p in study.kernel.parameters] == ["load", "shape", "drag", "grip", "hold"]
    assert study.kernel.parameter("load").upper == math.inf
    assert study.kernel.parameter("grip").default == "load"
    assert study.kernel.methods[0].excludes == ("drag", "grip")
    assert study.axes["method"].words == ("auto", "slow")
    assert study.to_json() == text
    with pytest.raises(sweep.SweepError, match="without its kernel"):
        study.kernel.check()
    with pytest.raises(sweep.SweepError, match="allow it with --allow-import"):
        Study.from_json(text)
    with pytest.raises(sweep.SweepError, match="cannot be loaded: AttributeError"):
        Study.from_json(text, allow_import=True)


@pytest.mark.parametrize("text", ["", "{}", "[]", "null", '{"format": 1}', '{"format": 1, "axes": [{}]}', "\x00"])
def test_other_json_is_refused(text):
    with pytest.raises(sweep.SweepError, match="not the JSON of a study"):
        Study.from_json(text)


def test_studies_differ_where_one_bit_does():
    assert build(axes={"height": [1.0]}) != build(axes={"height": [np.nextafter(1.0, 2)]})
