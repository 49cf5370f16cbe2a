"""How two results are put together, step by step, and what is said of those that do not fit."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from running import quiet
from toy import RICH
from toy_studies import build

from kernels.interface import Status
from sweep.explore import join as module
from sweep.explore.join import join
from sweep.study.model import Axis, frozen
from sweep.system.errors import SweepError

LOW, HIGH = (build(axes={"height": heights, "v0": [0.0, 1.0]}) for heights in ([1.0, 2.0], [2.0, 4.0]))


def axis(*values, words=None, name="height"):
    return Axis(name, frozen(values), "values", words)


@pytest.fixture(scope="module")
def results():
    """Of both studies; what a test changes is its own."""
    return tuple(quiet(study) for study in (LOW, HIGH))


def said(action):
    with pytest.raises(SweepError) as fault:
        action()
    return str(fault.value)


@pytest.mark.parametrize(("less", "fits"), [(0, True), (1, False)])
def test_both_and_what_is_made_of_them_fit_into_the_memory(results, monkeypatch, less, fits):
    needed = 2 * sum(found.nbytes for found in results)
    monkeypatch.setattr(module, "memory", lambda: needed - less)
    if fits:
        assert join(*results).sizes == {"height": 3, "v0": 2}
    else:
        assert said(lambda: join(*results)) == "the two results together do not fit into the memory"


def test_the_title_is_the_first_ones(results):
    first = build(axes={"height": [1.0]}, title="First")
    second = build(axes={"height": [2.0]}, title="Second")
    assert join(quiet(first), quiet(second)).attrs["title"] == "First"


def test_results_may_be_given_by_name_and_a_new_axis_only_so(results):
    assert join(a=results[0], b=results[1], path=None).sizes == {"height": 3, "v0": 2}
    with pytest.raises(TypeError, match="positional"):
        join(*results, None, "v")


def test_only_finished_cells_are_joined(results):
    found = results[0].copy(deep=True)
    only = "only results that keep their cells can be joined"
    assert said(lambda: module._require(found.drop_vars("status"))) == only
    assert said(lambda: module._require(found.drop_attrs())) == only
    module._require(found)
    found.status[1, 1] = Status.PENDING
    assert said(lambda: module._require(found)) == (
        "an unfinished result cannot be joined; run its sweep to the end first"
    )


def joined(*studies, axis=None, labels=()):
    return module._joined(studies, [xr.Dataset()] * 2, axis, labels)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({}, "they do not differ; name a new axis"),
        ({"outputs": ["impact_speed"]}, "they differ in outputs"),
        ({"fixed": {"g": 2.0}, "rtol": 1e-3}, "they differ in fixed.g and rtol"),
        ({"where": "height > 1"}, "they differ in where"),
    ],
)
def test_what_differs_is_named(changed, text):
    other = build(**{"axes": {"height": [1.0, 2.0], "v0": [0.0, 1.0]}, **changed})
    assert said(lambda: joined(LOW, other)) == f"the results do not fit together: {text}"


@pytest.mark.parametrize(
    ("name", "labels", "apart", "text"),
    [
        ("v", ("a", "b"), ["rtol", "where"], "along v all else is to be the same; they differ in rtol and where"),
        *(
            (name, ("a", "b"), [], f'"{name}" cannot be the name of a new axis; choose another')
            for name in (3, "a b", "height", "fall_time", "method", "rtol")
        ),
        *(
            ("v", labels, [], "a new axis needs two labels that differ")
            for labels in (("a",), ("a", "a"), ("a", "b", "c"), ("a", ""), ("a", 2))
        ),
    ],
)
def test_a_new_axis_has_a_name_that_is_free_and_two_labels(results, name, labels, apart, text):
    assert said(lambda: module._require_new(LOW, results[0], name, labels, apart)) == text
    module._require_new(LOW, results[0], "v", ("a", "b"), [])


def test_axes_that_run_together_are_one_thing_that_differs():
    keys = {"design": "zip", "axes": {"height": [1.0, 2.0], "v0": [0.0, 1.0]}}
    one, other = build(**keys), build(**{**keys, "axes": {"height": [3.0], "v0": [4.0]}})
    assert module._apart(one, other) == ["points"]
    assert module._apart(one, replace(one, rtol=1e-3)) == ["rtol"]
    assert "points" not in module._apart(one, build(design="zip", axes={"height": [3.0]}))
    assert module._apart(LOW, HIGH) == ["axes.height"]
    assert module._apart(LOW, replace(HIGH, rtol=1e-3)) == ["axes.height", "rtol"]


def test_a_setting_becomes_an_axis_of_its_words_or_numbers():
    exact, auto = replace(LOW, method="exact"), replace(LOW, method="auto", rtol=1e-3)
    found = module._new_axis(exact, auto, "method")
    assert (found.values.tolist(), found.words) == ([1.0, -1.0], ("exact", "auto"))
    found = module._new_axis(replace(LOW, method="rough"), exact, "method")
    assert (found.values.tolist(), found.words) == ([0.0, 1.0], ("rough", "exact"))
    found = module._new_axis(exact, auto, "rtol")
    assert (found.name, found.values.tolist(), found.words) == ("rtol", [LOW.rtol, 1e-3], None)


def test_a_fixed_parameter_becomes_an_axis_of_numbers_or_of_its_words():
    one, other = (replace(LOW, fixed={"g": g}) for g in (9.0, 2.0))
    found = module._new_axis(one, other, "g")
    assert (found.values.tolist(), found.words) == ([9.0, 2.0], None)
    none = "the results do not fit together: they differ in g, which is not one number in both"
    assert said(lambda: module._new_axis(one, LOW if "g" not in LOW.fixed else replace(LOW, fixed={}), "g")) == none
    assert said(lambda: module._new_axis(one, replace(LOW, fixed={"g": np.array([1.0, 2.0])}), "g")) == none
    shapes = [replace(LOW, kernel=RICH, fixed={"shape": number}) for number in (3.0, 0.0)]
    assert module._new_axis(*shapes, "shape").words == ("square", "round")


def test_a_result_that_is_put_above_another_loses_what_was_fixed(results):
    low = replace(LOW, fixed={"g": 9.0, "v": 1.0})
    study, whole = module._with_axis(low, [results[0], results[0]], axis(9.0, 2.0, name="g"))
    assert (list(study.axes), study.fixed, study.design) == (["g", "height", "v0"], {"v": 1.0}, "product")
    assert whole.fall_time.dims == ("g", "height", "v0")
    assert whole.g.values.tolist() == [9.0, 2.0]
    _, whole = module._with_axis(low, [results[0], results[0]], axis(0.0, 1.0, name="v", words=("a", "b")))
    assert whole.v.values.tolist() == ["a", "b"]


def test_points_under_a_new_axis_are_a_block_of_their_own():
    study = build(design="zip", axes={"height": [1.0, 2.0], "v0": [0.0, 1.0]})
    result = quiet(study)
    found, whole = module._with_axis(study, [result, result], axis(0.0, 1.0, name="v", words=("a", "b")))
    assert found.design == "blocks"
    assert [(block.design, block.axes) for block in found.blocks] == [("product", ("v",)), ("zip", ("height", "v0"))]
    assert list(whole.fall_time.dims) == ["v", *(dim for dim in found.dims if dim != "v")]


def test_a_new_axis_has_two_numbers_behind_its_labels(results):
    study, _ = module._joined((LOW, LOW), (results[0], results[0]), "v", ("a", "b"))
    assert (study.axes["v"].values.tolist(), study.axes["v"].words) == ([0.0, 1.0], ("a", "b"))


def test_points_are_called_as_in_a_study_of_blocks():
    old = SimpleNamespace(dims={"p": ("a", "b"), "c": ("c",), "z": ("d",)})
    new = SimpleNamespace(dims={"v": ("v",), "q": ("a", "b"), "c": ("c",), "k": ("d",)})
    assert module._points(old, new) == {"p": "q", "z": "k"}


@pytest.mark.parametrize("order", [1, -1])
def test_values_of_both_are_kept_once_and_ascend(results, order):
    pair = list(zip((LOW, HIGH), results, strict=True))[::order]
    (one, first), (other, second) = pair
    study, whole = module._longer(one, other, (first, second), "height")
    assert study.axes["height"].values.tolist() == [1.0, 2.0, 4.0]
    expected = np.concatenate([results[0].fall_time.values, results[1].fall_time.values[1:]])
    assert whole.fall_time.values.tolist() == expected.tolist()


def test_words_that_only_one_of_them_has_stand_behind_the_others():
    parts = [build(axes={"height": [1.0, 2.0], "method": [name]}) for name in ("exact", "rough")]
    found = join(*map(quiet, parts))
    assert found.method.values.tolist() == ["exact", "rough"]
    assert found.sizes == {"height": 2, "method": 2}


def test_fixed_parameters_and_settings_that_differ_become_axes(results):
    for other in (replace(LOW, fixed={**LOW.fixed, "g": 2.0}), replace(LOW, rtol=1e-3)):
        study, whole = module._joined((LOW, other), (results[0], results[0]), None, ())
        assert len(study.axes) == whole.fall_time.ndim == 3
    with pytest.raises(SweepError, match=r"they differ in where$"):
        module._joined((LOW, replace(LOW, where="height > 1")), results, None, ())


def test_words_of_both_keep_their_order():
    found = module._appended(axis(1.0, 0.0, words=("b", "a")), axis(2.0, 1.0, 3.0, words=("c", "b", "d")), [0, 2])
    assert (found.values.tolist(), found.words) == ([1.0, 0.0, 2.0, 3.0], ("b", "a", "c", "d"))
    assert module._appended(axis(1.0, words=("b",)), axis(2.0), [0]).words is None
    assert module._appended(axis(1.0), axis(2.0, words=("b",)), [0]).words is None


@pytest.mark.parametrize("what", ["status", "fall_time"])
def test_cells_of_both_that_differ_are_told(results, what):
    second = results[1].copy(deep=True)
    if what == "status":
        second.status[0, 1] = 1
    else:
        second.fall_time[0, 1] *= 1 + 1e-15
    text = said(lambda: module._require_same(results[0], second))
    assert text.startswith("the results do not fit together: cells that are in both differ\n")
    # values that only one of them has need not be looked at, where none is in both
    far = replace(HIGH, axes={**HIGH.axes, "height": axis(3.0, 4.0)})
    second = second.assign_coords(height=[3.0, 4.0])
    assert len(module._longer(LOW, far, (results[0], second), "height")[0].axes["height"]) == 4


def test_a_result_without_error_bounds_has_none(results):
    found = module._numbers(results[0].drop_vars("error_bound"), LOW)
    assert np.isnan(found.error_bound.values).all()
    assert (found.error_bound.dtype, found.error_bound.dims) == (np.float32, ("height", "v0"))
    assert list(found.coords) == []
    assert list(found.data_vars) == ["fall_time", "status", "method_used", "error_bound"]
    known = results[0].assign(error_bound=results[0].error_bound * 0 + 1)
    assert module._numbers(known, LOW).error_bound.identical(known.error_bound.drop_vars(known.coords))


def test_columns_have_the_order_of_the_grid_and_their_own_dimensions_last(results):
    turned = xr.Dataset({"x": (("k", "v0", "height"), np.arange(12.0).reshape(3, 2, 2))})
    column = module._column(turned, LOW, "x")
    assert column.shape == (4, 3)
    assert column.flags.c_contiguous
    assert column[1].tolist() == turned.x.isel(height=0, v0=1).values.tolist()


def test_each_result_tells_its_versions():
    found = module._versions([xr.Dataset(attrs={"versions": "v 1"}), xr.Dataset()], ["a", "b"])
    assert found == "a: v 1\nb: "
