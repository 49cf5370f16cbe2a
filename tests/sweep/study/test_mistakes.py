"""What a user is told of everything wrong in a study."""

import math
import sys

import numpy as np
import pytest
import toy
from toy_studies import HEAD, build, message_of

import sweep


def test_every_mistake_of_a_file_is_reported_at_once(read, tmp_path):
    with pytest.raises(sweep.StudyError) as caught:
        read(
            """
            kernel = "toy:KERNEL"
            rtoll = 1e-6
            method = "exakt"
            rtol = 2
            outputs = ["fall_time", "drop", "fal_time"]
            [axes.height]
            spacing = "log"
            start = 0
            stop = "5e-3"
            num = 0
            unit = "kg"
            [axes.v_0]
            values = [1.0]
            [fixed]
            g = { value = "9.81 m/s^2", units = "m/s^2" }
            height = 2
            [along]
            face = { num = 3 }
            """,
            head="",
        )
    # a message as a user reads it, whole
    assert str(caught.value).replace(str(tmp_path), "studies") == (
        """\
studies/fall.toml: 14 mistakes
  rtoll              no such key; did you mean rtol?
  method             expected "auto", "rough" or "exact", found "exakt"; did you mean exact?
  rtol               expected 1e-15 <= rtol < 1, found 2
  outputs[2]         expected "fall_time", "impact_speed" or "drop", found "fal_time"; did you mean fall_time?
  axes.height.unit   "kg" is a mass; height is a length, e.g. "m" or "mm"
  axes.height.start  a log axis needs start > 0, found 0
  axes.height.stop   expected a number, found "5e-3"; drop the quotes
  axes.height.num    expected at least 2, found 0; for a single value write values = [...]
  axes.v_0           kernel toy has no such parameter; did you mean v0?
  fixed.g.units      no such key; did you mean unit?
  fixed.g.value      expected a number, found "9.81 m/s^2"; write { value = 9.81, unit = "m/s^2" }
  fixed.height       height is an axis as well; keep one of the two
  along.face         kernel toy has no such coordinate; it has phase
  along.phase        missing; output drop needs it, e.g. num = 200"""
    )


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("fixed.height = 1", "axes"), ("[axes]\n[fixed]\nheight = 1", "axes"), ("axes.v0 = [1.0]", "fixed.height"),
        ("axes.height = []", "axes.height"), ("axes.height = [1, 2, 1.0]", "axes.height"),
        ("axes.height = [1, nan, 2, nan]", "axes.height"), ("axes.height = [1, [2]]", "axes.height[1]"),
        ("axes.method = ['auto', 'auto']\nfixed.height = 1", "axes.method"), ("axes.height = 3.0", "axes.height"),
        ("axes.height = {}", "axes.height"), ("axes.height = { values = [1], file = 'x' }", "axes.height"),
        ("axes.height = { values = [1], num = 1 }", "axes.height.num"),
        ("axes.height = { spacing = 'linear', start = nan, stop = 2, num = 3 }", "axes.height.start"),
        ("axes.height = { spacing = 'linear', start = 1, stop = inf, num = 3 }", "axes.height.stop"),
        ("axes.height = { spacing = 'linear', start = 1, stop = 1, num = 3 }", "axes.height.stop"),
        ("axes.height = { spacing = 'log', start = 1e300, stop = 1e308, num = 3, unit = 'km' }", "axes.height"),
        ("axes.height = { spacing = 'log', start = 1e-320, stop = 1, num = 3, unit = 'nm' }", "axes.height"),
        ("axes.height = [9007199254740993]", "axes.height[0]"), (f"axes.height = [1{'0' * 400}]", "axes.height[0]"),
        ("axes.rtol = [1e-3, 1]\nfixed.height = 1", "axes.rtol"), ("axes.height = [1]\nfixed.G = 1", "fixed.G"),
        ("axes.height = [1]\naxes.rtol = [1e-3]\nrtol = 1e-3", "rtol"),
        ("axes.height = [1]\naxes.method = ['auto']\nmethod = 'auto'", "method"),
        ("axes.height = { spacing = 'log', start = 1, stop = 2 }\ndesign = 'sobol'", "design"),
        ("axes.height = [1]\nfixed.height = 1", "fixed.height"), ("axes.height = [1]\nfixed.g = [1, 2]", "fixed.g"),
        ("axes.height = [1]\nfixed.g = { value = [1], unit = 'm/s^2' }", "fixed.g.value"),
        ("axes.height = [1]\nfixed.quality = 1", "fixed.quality"), ("axes.height = [1]\nfixed.rtol = 1", "fixed.rtol"),
        ("axes.height = [1]\nalong.phase = [0, 2]", "along.phase"), ("axes.height = [1]\nalong.r.num = 5", "along.r"),
        ('design = "zip"\naxes.height = [1, 2]\naxes.v0 = [1, 2, 3]', "axes"),
        ("axes.height.file = '../b.csv'", "axes.height.file"), ("axes.height = [1]\nwhere = 'height > v0'", "where"),
    ],
)  # fmt: skip
def test_what_does_not_fit_together_is_told_where_it_stands(mistakes, tmp_path, text, where):
    (tmp_path.parent / "b.csv").write_text("height\n1\n")
    found = mistakes(text)
    assert list(found) == [where]


def test_the_messages_say_what_to_do(mistakes):
    for text, where, word in (
        ("axes.height = ['1e3']", "axes.height[0]", "drop the quotes"),
        ("axes.height = [1]\nfixed.g = '9.81 m/s^2'", "fixed.g", "unit = "),
        ("axes.height = [1]\nfixed.quality = 1", "fixed.quality", "height, v0 and g"),
        ("axes.height = [1]\nfixed.v0 = -0.5", "fixed.v0", ">= 0 m/s"),
        ("axes.height = [1]\nfixed.g = 0", "fixed.g", "> 0 m/s^2"),
    ):
        assert word in mistakes(text)[where]


@pytest.mark.parametrize(("flips", "good"), [(1, True), (2.5, False), (0, False), (1e300, False)])
def test_a_fixed_number_that_is_to_be_whole_is(mistakes, read, flips, good):
    text = f"kernel = 'foliot_steps'\naxes.mu = [1]\nfixed = {{ a = 1, phi0 = 1, step = 0.1, flips = {flips} }}"
    if good:
        assert read(text, head="").fixed["flips"] == flips
    else:
        assert "expected a whole number >= 1, <= " in mistakes(text, head="")["fixed.flips"]


def test_too_many_cells_are_refused_before_memory_is_asked_for(mistakes):
    axis = '{{ spacing = "linear", start = 1, stop = 2, num = {} }}'
    found = mistakes(
        f"axes.height = {axis.format(30_000)}\naxes.v0 = {axis.format(20_000)}\naxes.g = {axis.format(10_000)}"
    )
    assert found["axes"] == "30000 x 20000 x 10000 cells; a study may have at most 1e+12"


def test_a_list_that_is_too_long_is_refused():
    assert message_of(lambda: build(axes={"height": range(10_000_001)}), "axes.height") == (
        "expected at most 10000000 values, found 10000001"
    )


@pytest.mark.parametrize("values", [[1.0, math.nan], [math.inf], [-1.0], [0]])
def test_values_outside_the_limits_are_no_mistake_of_the_study(values):
    assert build(axes={"height": values}).axes["height"].values.shape == (len(values),)


@pytest.mark.parametrize(
    "values",
    [
        (1, 2.5),
        np.array([1.0, 2.5], dtype=np.float32),
        [np.float32(1), np.float64(2.5)],
        [np.int8(1), 2.5],
        [np.array(1.0), 2.5],
    ],
)
def test_lists_of_numbers_of_any_kind_are_taken(values):
    assert build(axes={"height": values}).axes["height"].values.tolist() == [1.0, 2.5]


@pytest.mark.parametrize(
    ("values", "where"),
    [
        (np.ones((2, 2)), "axes.height[0]"),
        (np.array([True]), "axes.height[0]"),
        (np.array(3.0), "axes.height"),
        (None, "axes.height"),
        (["1"], "axes.height[0]"),
        ([1j], "axes.height[0]"),
        ({1.0, 2.0}, "axes.height"),
        (np.array([2**60 + 1]), "axes.height[0]"),
    ],
)
def test_arrays_that_are_no_list_of_numbers_are_refused(values, where):
    assert message_of(lambda: build(axes={"height": values}), where).startswith(
        ("expected", "1152921504606846977 is not exact")
    )


ROWS = {"kernel": "beads:KERNEL", "design": "zip"}
SPACED = {"spacing": "linear", "start": 1.0, "stop": 2.0}
SOBOL = {"kind": "sobol", "n": 4}


@pytest.mark.parametrize(
    ("keys", "where"),
    [
        ({**ROWS, "fixed": {"mass": {"value": [1.0], "file": "rod.csv"}}, "axes": {"g": [1.0]}}, "fixed.mass"),
        ({**ROWS, "axes": {"mass": {**SPACED, "num": 3}}}, "axes.mass.spacing"),
        ({**ROWS, "axes": {"mass": {"file": 3}}}, "axes.mass.file"),
        ({**ROWS, "axes": {"mass": {"file": "nowhere.csv"}}}, "axes.mass.file"),
        ({**ROWS, "axes": {"mass": np.ones((0, 2))}}, "axes.mass"),
        ({**ROWS, "design": SOBOL, "fixed": {"mass": [1.0]}, "axes": {"place": SPACED}}, "axes.place"),
        ({"kernel": "toy:RICH", "axes": {"load": [1.0]}, "fixed": {"shape": {"value": "round", "unit": "m"}}},
         "fixed.shape.unit"),
        ({"kernel": "toy:RICH", "axes": {"load": [1.0], "shape": {**SPACED, "num": 2}}}, "axes.shape"),
        ({**ROWS, "design": {"kind": "sobol", "n": 12}, "axes": {"g": SPACED}, "fixed": {"mass": [1.0]}}, "design.n"),
        ({**ROWS, "design": {"kind": "saltelli", "n": 2**23}, "axes": {"g": SPACED}, "fixed": {"mass": [1.0]}},
         "design.n"),
        ({**ROWS, "axes": {"g": [1.0]}, "fixed": {"mass": [1.0]}, "where": "g > " + "1 + " * 300 + "1"}, "where"),
    ],
)  # fmt: skip
def test_what_an_array_a_word_or_a_design_cannot_be_is_told(keys, where):
    with pytest.raises(sweep.StudyError) as caught:
        sweep.study(keys, allow_import=True)
    assert where in {m.where for m in caught.value.mistakes}


def test_arrays_of_numpy_are_rows_and_paths_of_python_may_be_anywhere(tmp_path):
    (tmp_path / "rows.csv").write_text("mass_1,mass_2\n1,2\n3,4\n")
    rows = np.array([[1.0, 2.0], [3.0, 4.0]])
    for given in (rows, rows.tolist(), {"file": tmp_path / "rows.csv"}, {"values": 1000 * rows, "unit": "g"}):
        study = sweep.study(ROWS | {"axes": {"mass": given}}, allow_import=True)
        np.testing.assert_array_equal(study.axes["mass"].values, rows)


@pytest.mark.parametrize(
    "given", [3, "a = 1\nb = 2", "a.h5", "a.py", "nowhere.toml", ".", "/dev/zero", "\0.toml"], ids=str
)
def test_what_is_no_study_is_refused_in_one_line(given):
    with pytest.raises(sweep.SweepError) as caught:
        sweep.study(given)
    assert "\n" not in str(caught.value)


# kernels


@pytest.mark.parametrize(
    ("kernel", "message"),
    [
        ('"toy:KERNELL"', "cannot be loaded: AttributeError: module 'toy' has no attribute 'KERNELL'"),
        ('"no_such_module:K"', "cannot be loaded: ModuleNotFoundError"),
        ('"toy:check"', "is a function, not a kernels.interface.Kernel"),
        ('":"', "cannot be loaded: ValueError"),
        ("3", "expected the name of a kernel, found 3; there are foliot"),
        ('""', "expected the name of a kernel"),
    ],
)
def test_a_kernel_that_cannot_be_had_is_a_mistake(mistakes, kernel, message):
    assert message in mistakes(f"kernel = {kernel}\naxes.height = [1]", head="")["kernel"]


def test_a_module_of_ones_own_is_not_imported_unless_allowed(mistakes, tmp_path, monkeypatch):
    (tmp_path / "trap.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    found = mistakes('kernel = "trap:KERNEL"\naxes.height = [1]', head="", allow_import=False)
    assert "allow it with --allow-import" in found["kernel"]


def test_a_fault_in_a_module_of_ones_own_is_told_in_one_line(mistakes, tmp_path):
    (tmp_path / "broken_kernel.py").write_text("1 / 0")
    found = mistakes('kernel = "broken_kernel:KERNEL"\naxes.height = [1]', head="")
    assert found["kernel"] == '"broken_kernel:KERNEL" cannot be loaded: ZeroDivisionError: division by zero'


@pytest.mark.parametrize("said", ["", "0", "'no licence'"])
def test_a_module_of_ones_own_that_ends_python_is_a_mistake(mistakes, tmp_path, said):
    name = f"ending_kernel_{len(said)}"
    (tmp_path / f"{name}.py").write_text(f"raise SystemExit({said})")
    found = mistakes(f'kernel = "{name}:KERNEL"\naxes.height = [1]', head="")
    told = said.strip("'")
    assert found["kernel"] == f'"{name}:KERNEL" cannot be loaded: SystemExit: {told}'


def test_a_kernel_beside_the_study_is_found(read, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "own_kernel.py").write_text("from toy import KERNEL")
    assert (
        read('kernel = "own_kernel:KERNEL"\naxes.height = [1]\noutputs = ["fall_time"]', head="").kernel is toy.KERNEL
    )


# files that are no study


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("a = = 3", "line 1", "Invalid value: a = = 3"),
        ("a = 1\nb = 2\na = 3\n", "line 3", "this key or table stands here a second time: a = 3"),
        ("[axes.mu]\nnum = 1\n[axes.mu]\n", "line 3", "this key or table stands here a second time: [axes.mu]"),
        ("a = 'x", "end of file", "Expected"),
        ("a = [1, 2", "end of file", "Unclosed array"),
        ("a = " + "1" * 5000, "file", "an integer has thousands of digits"),
        ("a = " + "[" * 50_000, "file", "lists or tables are nested too deeply"),
    ],
)
def test_toml_that_cannot_be_read_is_told_by_line(mistakes, text, where, message):
    found = mistakes(text, head="")
    assert list(found) == [where]
    assert message in found[where]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b" \n\n", "is empty"),
        (b"\x89HDF\r\n\x1a\n\x00", "is not a text file in UTF-8 (byte 0)"),
        (b"title = '\xe4'", "is not a text file in UTF-8 (byte 9)"),
    ],
)
def test_a_file_that_is_no_text_is_refused(tmp_path, content, message):
    path = tmp_path / "s.toml"
    path.write_bytes(content)
    with pytest.raises(sweep.SweepError) as caught:
        sweep.study(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_a_missing_file_is_told_with_the_nearest_name(tmp_path):
    (tmp_path / "foliot_scaling.toml").write_text("x")
    with pytest.raises(
        sweep.SweepError, match=r"foliot_scalling.toml: no such file; did you mean foliot_scaling.toml\?"
    ):
        sweep.study(tmp_path / "foliot_scalling.toml")


def test_a_folder_is_no_study(tmp_path):
    with pytest.raises(sweep.SweepError, match="is a folder; name a study file in it"):
        sweep.study(tmp_path)


def test_no_byte_salad_ends_in_a_traceback(tmp_path):
    rng = np.random.default_rng(0)
    sound = (
        HEAD + 'axes.height = { spacing = "log", start = 1, stop = 10, num = 3, unit = "m" }\nfixed.g = 9.8\n'
    ).encode()
    for _ in range(300):
        text = bytearray(sound)
        for place in rng.integers(0, len(text), 3):
            text[place] = rng.choice(list(b'"[]{}=.\n 0e-x#'))
        path = tmp_path / "s.toml"
        path.write_bytes(text)
        try:
            sweep.study(path, allow_import=True)
        except sweep.SweepError:
            continue
