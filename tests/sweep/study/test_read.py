"""What studies in TOML and Python become: axes, csv files, words, followers, array parameters, summaries, kernels."""

import dataclasses
import sys

import numpy as np
import pytest
import toy
from toy_studies import build, build_rich, message_of

import sweep
from kernels.interface import Field
from sweep.study.model import load_kernel

MASS = [0.1, 0.2, 0.7]


def beads(fixed=None, **keys):
    given = {"fixed": {"mass": MASS} if fixed is None else fixed, "axes": {"g": [1.0, 2.0]}} | keys
    return sweep.study(kernel="beads:KERNEL", allow_import=True, **given)


def test_python_and_toml_give_the_same_study_with_numbers_of_its_own(read):
    speeds = np.array([1e-3, 1e-6])
    height = {"spacing": "log", "start": 0.3, "stop": 1e5, "num": 57, "unit": "ft"}
    python = build(title="t", axes={"height": height, "rtol": speeds}, fixed={"g": {"value": 32.174, "unit": "ft/s^2"}})
    speeds[0] = 5
    toml = read(
        """
        title = "t"
        axes.height = { spacing = "log", start = 0.3, stop = 1e5, num = 57, unit = "ft" }
        axes.rtol.values = [1e-3, 1e-6]
        fixed.g = { value = 32.174, unit = "ft/s^2" }
        """
    )
    assert dataclasses.replace(toml, text="") == python
    with pytest.raises(ValueError, match="read-only"):
        python.axes["height"].values[0] = 2
    assert python != build(axes={"height": [1.0]}) != build(axes={"height": [np.nextafter(1.0, 2)]})


def test_a_coordinate_that_counts_takes_the_first_whole_numbers():
    keys = {"kernel": "foliot_start", "axes": {"mu": [1.0]}, "fixed": {"phi0": 1, "a": 1}}
    assert sweep.study(**keys, along={"flip": {"num": 4}}).along["flip"].tolist() == [1.0, 2.0, 3.0, 4.0]
    with pytest.raises(sweep.StudyError, match="whole number >="):
        sweep.study(**keys, along={"flip": [1, 2.5]})


def test_a_coordinate_with_a_default_need_not_be_given():
    keys = {"kernel": "forced_scene:FORCED", "axes": {"w": [1.0, 2.0]}, "allow_import": True}
    assert sweep.study(**keys).along["floquet_mode"].tolist() == [1.0, 2.0, 3.0]
    assert sweep.study(**keys, along={"floquet_mode": [2.0]}).along["floquet_mode"].tolist() == [2.0]
    assert not len(sweep.study(**keys, outputs=["period"]).along["floquet_mode"])
    assert "3 values" in sweep.kernels("forced_scene:FORCED", allow_import=True)._repr_html_()
    assert "estimated per cell" in str(sweep.kernels("forced_scene:FORCED", allow_import=True))
    with pytest.raises(sweep.StudyError, match="<= 3"):
        sweep.study(**keys, along={"floquet_mode": [4.0]})


# csv files


@pytest.mark.parametrize(
    "text",
    [
        "height\n1\n2.5\n1e3\n",
        "1\n2.5\n1e3\n",
        '# heights [m], said "roughly\n\nv0,height\n0,1\n# one more\n0, 2.5\n\n0,1e3',
        "\ufeffheight,v0\r\n1,0\r\n2.5,0\r\n1e3,0\r\n",
    ],
)
def test_an_axis_may_be_a_column_of_a_csv_file(read, tmp_path, text):
    (tmp_path / "points.csv").write_text(text, encoding="utf-8", newline="")
    study = read('axes.height.file = "points.csv"')
    assert study.axes["height"].values.tolist() == [1.0, 2.5, 1000.0]
    assert study.axes["height"].spacing == "file"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("height\n1\nabc\n", 'line 3: expected a number, found "abc"'),
        ("height\n1\n\n# x\n''\n", "line 5: expected a number"),
        ("height,v0\n1,2\n3\n", "line 3: expected 2 columns, found 1"),
        ("height,v0\n1,2\n3,4,5\n", "line 3: expected 2 columns, found 3"),
        ("v0,g\n1,2\n", 'no column "height"'),
        ("height,v0,height\n1,2,3\n", "two columns"),
        ("v0\n1\n", 'line 1: expected a number, found "v0"'),
        ("height\n", "holds no values"),
        ("", "holds no values"),
        (b"height\n\xff\n", "is not a csv file"),
        (b"height\n\x00\n", "points.csv"),
        (bytes(1_000_000), "is not a csv file"),
    ],
    ids=range(12),
)
def test_a_bad_csv_file_is_told_by_line(mistakes, tmp_path, text, message):
    (tmp_path / "points.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    assert message in mistakes('axes.height.file = "points.csv"')["axes.height.file"]


# words, followers, methods


def test_words_become_the_numbers_of_the_kernel(read, tmp_path):
    study = build_rich(axes={"load": [1.0], "shape": ["square", "round"], "method": ["slow", "auto"]})
    assert (study.axes["shape"].values.tolist(), study.axes["shape"].words) == ([3.0, 0.0], ("square", "round"))
    assert study.axes["method"].values.tolist() == [1.0, -1.0]
    assert build_rich(fixed={"shape": "square"}).fixed["shape"] == 3.0
    (tmp_path / "points.csv").write_text("height,method\n1,exact\n2,auto\n")
    study = read('design = "zip"\naxes.height.file = "points.csv"\naxes.method.file = "points.csv"')
    assert (study.axes["method"].words, study.axes["method"].values.tolist()) == (("exact", "auto"), [1.0, -1.0])


def test_a_method_that_cannot_do_a_term_of_the_study_is_a_mistake():
    drag = {"load": [1.0], "drag": [0.0, 1.0], "method": ["quick", "slow"]}
    for keys, where in (({"method": "quick", "fixed": {"drag": 0.1}}, "method"), ({"axes": drag}, "axes.method")):
        assert "quick cannot do drag" in message_of(lambda keys=keys: build_rich(**keys), where)
    all_terms = {"drag": 0.1, "grip": 3, "hold": 2}
    assert "no method of rich" in message_of(lambda: build_rich(fixed=all_terms), "method")
    for keys in (  # a term at its default is no hindrance
        {"method": "quick", "fixed": {"drag": 0}},
        {"axes": {"drag": [0.0]}, "fixed": {"load": 5, "grip": 5}, "method": "slow"},
        {"axes": {"shape": ["round"]}, "fixed": {"load": 5, "grip": 5, "hold": 5}, "method": "quick"},
    ):
        assert build_rich(**keys).method == keys["method"]


# array parameters


def test_arrays_come_from_lists_of_any_unit_columns_of_files_and_rows(tmp_path):
    (tmp_path / "rod.csv").write_text("mass,place\n100,1\n200,2\n700,3\n")
    (tmp_path / "rows.csv").write_text("mass_1,mass_2\n1,2\n3,4\n")
    file = tmp_path / "rod.csv"
    fixed = beads({"mass": {"value": [100, 200, 700], "unit": "g"}, "place": {"value": 30, "unit": "mm"}}).fixed
    columns = beads({"mass": {"file": file, "unit": "g"}, "place": {"file": file}}).fixed
    assert (fixed["mass"].tolist(), fixed["place"].tolist()) == (MASS, [0.03] * 3)
    assert (columns["mass"].tolist(), columns["place"].tolist()) == (MASS, [1.0, 2.0, 3.0])
    rows = np.array([[1.0, 2.0], [3.0, 4.0]])
    for given in (rows, rows.tolist(), {"file": tmp_path / "rows.csv"}, {"values": 1000 * rows, "unit": "g"}):
        found = beads({}, axes={"mass": given, "g": [1.0, 2.0]}, design="zip").axes["mass"].values
        np.testing.assert_array_equal(found, rows)


# what a summary, and a kernel's declaration, hold


def test_a_summary_reduces_all_axes_and_outputs_in_order_unless_told_otherwise():
    axes = {"height": [1.0, 2.0], "v0": [0.0, 1.0], "g": [1.0, 2.0]}
    found = build(axes=axes, summary={}).summary
    assert found.over == ("height", "v0", "g")
    assert found.outputs == {"fall_time": ("min", "max", "mean", "argmin", "argmax")}
    some = build(axes=axes, summary={"over": ["g", "height"], "outputs": {"fall_time": ["argmax", "min"]}}).summary
    assert (some.over, some.outputs) == (("height", "g"), {"fall_time": ("min", "argmax")})
    axes = {"mu": [0.1, 1.0], "R": [0.01, 0.02]}
    study = sweep.study(kernel="foliot", axes=axes, fixed={"phi0": 1.0, "a": 1.0}, summary={"over": ["mu"]})
    assert (study.title, list(study.axes)) == ("foliot over R and mu", ["R", "mu"])  # those that stay first


def test_no_reduction_may_be_called_as_an_axis():
    time, height = Field("fall_time", "s", ""), toy.KERNEL.parameters[0]
    axis = dataclasses.replace(height, name="fall_time_min")
    toy.OWN = dataclasses.replace(toy.KERNEL, parameters=(height, axis), outputs=(time,), along=())
    keys = {"kernel": "toy:OWN", "axes": {"height": [1.0], "fall_time_min": [1.0]}, "summary": {}}
    assert "fall_time_min" in message_of(lambda: build(**keys), "summary.outputs")
    del toy.OWN


@pytest.mark.parametrize("name", ["status", "method_used", "error_bound", "method", "rtol", "cell", "height", "phase"])
def test_a_kernel_declares_each_name_once_and_none_of_the_results_own_and_units(name):
    wrong = {
        name: (Field(name, "s", ""),),
        "foo": (Field("time", "foo", ""),),
        "place": (*toy.KERNEL.outputs, Field("trace", "s", "", dims=("place",))),
    }
    for said, outputs in wrong.items():
        toy.OWN = dataclasses.replace(toy.KERNEL, outputs=outputs)
        with pytest.raises(sweep.SweepError, match=said):
            load_kernel("toy:OWN", True)
    del toy.OWN


def test_a_kernel_beside_the_study_is_found(read, tmp_path):
    path = list(sys.path)
    try:
        (tmp_path / "own_kernel.py").write_text("from toy import KERNEL")
        study = read('kernel = "own_kernel:KERNEL"\naxes.height = [1]\noutputs = ["fall_time"]', head="")
        assert study.kernel is toy.KERNEL
    finally:
        sys.path[:] = path
