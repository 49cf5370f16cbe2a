"""What studies in TOML and Python become."""

import dataclasses
import tracemalloc

import mpmath
import numpy as np
import pytest
import toy
from hypothesis import given
from hypothesis import strategies as st
from toy_studies import build, build_rich, message_of

import sweep
from sweep.cells.grid import Grid
from sweep.study import spacing as axes


def test_a_whole_study_is_read(read):
    study = read(
        """# How fast does a stone fall?
        title = "Falling stones"
        kernel = "toy:KERNEL"
        method = "exact"
        rtol = 1e-6
        outputs = ["drop", "fall_time"]
        axes.v0 = [0, 0.5]
        [axes.height]
        spacing = "log"
        start = 1
        stop = 100
        num = 3
        unit = "mm"
        [fixed]
        g = { value = 981, unit = "cm/s^2" }
        [along.phase]
        num = 3
        """,
        head="",
    )
    assert (study.title, study.question) == ("Falling stones", "How fast does a stone fall?")
    assert (study.kernel_name, study.kernel, study.method, study.rtol) == ("toy:KERNEL", toy.KERNEL, "exact", 1e-6)
    assert study.outputs == ("fall_time", "drop")  # the kernel's order
    assert [f.name for f in study.asked] == ["fall_time", "drop"]
    assert list(study.axes) == ["v0", "height"]
    assert study.axes["height"].values.tolist() == [0.001, 0.01, 0.1]
    assert study.axes["height"].spacing == "log"
    assert study.axes["v0"].spacing == "values"
    assert study.fixed == {"g": 9.81}
    assert study.along["phase"].tolist() == [0.0, 0.5, 1.0]
    assert "spacing" in study.text


def test_defaults_are_filled_in(read):
    study = read("axes.height = [1.0]")
    assert (study.method, study.rtol, study.design, study.question) == ("auto", 1e-9, "product", "")
    assert study.title == "toy over height"
    assert study.fixed == {"v0": 0.0, "g": 9.80665}


FLIPS = """
kernel = "foliot_start"
axes.mu = [1.0]
fixed = {{ phi0 = 1, a = 1 }}
along.flip = {}
"""


def test_a_coordinate_that_counts_takes_the_first_whole_numbers(tmp_path):
    path = tmp_path / "flips.toml"
    path.write_text(FLIPS.format("{ num = 4 }"))
    assert sweep.study(path).along["flip"].tolist() == [1.0, 2.0, 3.0, 4.0]
    path.write_text(FLIPS.format("[1, 2.5]"))
    with pytest.raises(sweep.SweepError, match=r"expected whole numbers from 1 to 1e\+06, found 2.5"):
        sweep.study(path)


def test_python_and_toml_give_the_same_study(read):
    toml = read(
        """
        title = "t"
        method = "exact"
        [axes.height]
        spacing = "log"
        start = 0.3
        stop = 1e5
        num = 57
        unit = "ft"
        [axes.v0]
        spacing = "linear"
        start = -1
        stop = 1.7
        num = 28
        unit = "km/hour"
        [axes.rtol]
        values = [1e-3, 1e-6]
        [fixed]
        g = { value = 32.174, unit = "ft/s^2" }
        """
    )
    python = build(
        title="t",
        method="exact",
        axes={
            "height": {"spacing": "log", "start": 0.3, "stop": 1e5, "num": 57, "unit": "ft"},
            "v0": {"spacing": "linear", "start": -1, "stop": 1.7, "num": 28, "unit": "km/hour"},
            "rtol": np.array([1e-3, 1e-6]),
        },
        fixed={"g": {"value": 32.174, "unit": "ft/s^2"}},
    )
    assert dataclasses.replace(toml, text="") == python
    for name, axis in toml.axes.items():
        assert axis.values.tobytes() == python.axes[name].values.tobytes()


def test_axes_cannot_be_written_to():
    study = build(axes={"height": [1.0]})
    with pytest.raises(ValueError, match="read-only"):
        study.axes["height"].values[0] = 2


def test_an_axis_does_not_share_memory_with_the_array_it_came_from():
    values = np.array([1.0, 2.0])
    study = build(axes={"height": values})
    values[0] = 5
    assert study.axes["height"].values[0] == 1.0


# spacings


@given(st.floats(1e-300, 1e300), st.floats(1e-300, 1e300), st.integers(2, 40), st.sampled_from(["log", "linear"]))
def test_the_first_and_last_values_are_exactly_start_and_stop(start, stop, num, spacing):
    if start == stop or abs(start - stop) < 1e-6 * start:
        return
    values = (
        build(axes={"height": {"spacing": spacing, "start": start, "stop": stop, "num": num}}).axes["height"].values
    )
    assert (values[0], values[-1], len(values)) == (start, stop, num)
    assert (np.diff(values) > 0).all() if stop > start else (np.diff(values) < 0).all()


@given(st.floats(1e-20, 1e20), st.floats(1e-20, 1e20), st.integers(3, 30))
def test_log_values_are_the_nearest_floats_to_the_true_geometric_ones(start, stop, num):
    if abs(start - stop) < 1e-6 * start:
        return
    values = build(axes={"height": {"spacing": "log", "start": start, "stop": stop, "num": num}}).axes["height"].values
    with mpmath.workdps(60):
        # the decimals that the user wrote, not the floats they became
        first, last = mpmath.mpf(repr(start)), mpmath.mpf(repr(stop))
        expected = [float(first * (last / first) ** (mpmath.mpf(i) / (num - 1))) for i in range(1, num - 1)]
    assert values[1:-1].tolist() == expected


@pytest.mark.parametrize("spacing", ["log", "linear"])
def test_an_axis_with_a_unit_is_what_its_values_are_one_by_one(spacing):
    axis = {"spacing": spacing, "start": 1, "stop": 1000, "num": 4, "unit": "ms"}
    numbers = build(axes={"height": {**axis, "unit": "mm"}}).axes["height"].values
    listed = [1, 10, 100, 1000] if spacing == "log" else [1, 334, 667, 1000]
    assert numbers.tolist() == build(axes={"height": {"values": listed, "unit": "mm"}}).axes["height"].values.tolist()
    assert numbers.tolist() == [n / 1000 for n in listed]
    assert [build(axes={"height": [1.0]}, fixed={"v0": {"value": n, "unit": "mm/s"}}).fixed["v0"] for n in listed] == [
        n / 1000 for n in listed
    ]


# files


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


def test_words_may_come_from_a_file(read, tmp_path):
    (tmp_path / "points.csv").write_text("height,method\n1,exact\n2,auto\n")
    study = read('design = "zip"\naxes.height.file = "points.csv"\naxes.method.file = "points.csv"')
    assert study.axes["method"].words == ("exact", "auto")
    assert study.axes["method"].values.tolist() == [1.0, -1.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("height\n1\nabc\n", 'points.csv, line 3: expected a number, found "abc"'),
        ("height\n1\n\n# x\n''\n", "points.csv, line 5: expected a number, found \"''\""),
        ("height,v0\n1,2\n3\n", "points.csv, line 3: expected 2 columns, found 1"),
        ("v0,g\n1,2\n", 'points.csv has no column "height"; its first line is v0,g'),
        ("v0\n1\n", 'points.csv, line 1: expected a number, found "v0"'),
        ("height\n", "points.csv holds no values"),
        ("", "points.csv holds no values"),
        (b"height\n\xff\n", "points.csv is not a csv file"),
        (b"height\n\x00\n", "points.csv"),
    ],
)
def test_a_bad_csv_file_is_told_by_line(mistakes, tmp_path, text, message):
    (tmp_path / "points.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    found = mistakes('axes.height.file = "points.csv"')["axes.height.file"]
    assert message in found


def test_a_csv_file_without_ends_of_lines_does_not_fill_the_memory(tmp_path):
    with (tmp_path / "points.csv").open("wb") as file:
        file.truncate(100_000_000)
    tracemalloc.start()
    with pytest.raises(ValueError, match=r"points\.csv is not a csv file: a line is longer than 1,000,000 characters"):
        axes.read_column(tmp_path / "points.csv", "height")
    assert tracemalloc.get_traced_memory()[1] < 10e6
    tracemalloc.stop()


# words, followers, methods


def test_words_become_the_numbers_of_the_kernel():
    study = build_rich(axes={"load": [1.0], "shape": ["square", "round"], "method": ["slow", "auto"]})
    assert study.axes["shape"].values.tolist() == [3.0, 0.0]
    assert study.axes["shape"].words == ("square", "round")
    assert study.axes["method"].values.tolist() == [1.0, -1.0]
    assert build_rich(fixed={"shape": "square"}).fixed["shape"] == 3.0


def test_a_parameter_that_follows_an_axis_is_not_fixed():
    study = build_rich()
    assert study.follows == {"grip": "load", "hold": "load"}
    assert study.fixed == {"shape": 0.0, "drag": 0.0}


def test_a_parameter_that_follows_a_fixed_one_has_its_value():
    study = build_rich(axes={"drag": [0.0, 1.0]}, fixed={"load": 5, "grip": 7}, method="auto")
    assert study.follows == {}
    assert study.fixed == {"load": 5.0, "shape": 0.0, "grip": 7.0, "hold": 7.0}


def test_a_follower_takes_the_column_of_its_axis():
    study = build_rich()
    out = [np.zeros(2) for _ in study.kernel.parameters]
    Grid(study).columns(0, 2, out)
    assert [column.tolist() for column in out] == [[1, 2], [0, 0], [0, 0], [1, 2], [1, 2]]


def test_a_method_that_cannot_do_a_term_of_the_study_is_a_mistake():
    assert message_of(lambda: build_rich(method="quick", fixed={"drag": 0.1}), "method") == (
        "quick cannot do drag; use auto or slow"
    )
    axes = {"load": [1.0], "drag": [0.0, 1.0], "method": ["quick", "slow"]}
    assert message_of(lambda: build_rich(axes=axes), "axes.method") == "quick cannot do drag; use auto or slow"
    both = {"drag": 0.1, "grip": 3, "hold": 2}
    assert (
        message_of(lambda: build_rich(fixed=both), "method") == "no method of rich can do drag, grip and hold together"
    )


def test_a_term_at_its_default_is_no_hindrance():
    assert build_rich(method="quick", fixed={"drag": 0}).method == "quick"
    assert build_rich(axes={"drag": [0.0]}, fixed={"load": 5, "grip": 5}, method="slow").method == "slow"
    assert (
        build_rich(axes={"shape": ["round"]}, fixed={"load": 5, "grip": 5, "hold": 5}, method="quick").method == "quick"
    )


def test_the_title_that_a_summary_gets_names_the_axes_that_stay_first():
    axes = {"mu": [0.1, 1.0], "R": [0.01, 0.02]}
    study = sweep.study(kernel="foliot", axes=axes, fixed={"phi0": 1.0, "a": 1.0}, summary={"over": ["mu"]})
    assert study.title == "foliot over R and mu"
    assert list(study.axes) == ["R", "mu"]
