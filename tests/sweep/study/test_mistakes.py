"""What a user is told of everything wrong in a study."""

import math
import sys

import numpy as np
import pytest
import toy
from toy_studies import HEAD, build, build_rich, message_of

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


def axis(spacing, start, stop, num):
    return f"axes.height = {{ spacing = '{spacing}', start = {start}, stop = {stop}, num = {num} }}"


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("fixed.height = 1", "axes", "missing; give at least one"),
        ("axes = 3\nfixed.height = 1", "axes", "expected a table, found 3"),
        ("[axes]\n[fixed]\nheight = 1", "axes", "missing; give at least one"),
        ("axes.v0 = [1.0]", "fixed.height", "missing; height (height above the ground, m) has no default: give it"),
        ("axes.height = []", "axes.height", "has no values"),
        ("axes.height = [1, 2, 1.0]", "axes.height", "1 stands more than once"),
        ("axes.height = [1, nan, 2, nan]", "axes.height", "nan stands more than once"),
        ("axes.method = ['auto', 'auto']\nfixed.height = 1", "axes.method", "auto stands more than once"),
        ("axes.height = [1, true]", "axes.height[1]", "expected a number, found true"),
        ("axes.height = [1, [2]]", "axes.height[1]", "expected a number, found a list"),
        ("axes.height = [1, 1979-05-27]", "axes.height[1]", "expected a number, found a date"),
        ("axes.height = ['1e3']", "axes.height[0]", 'expected a number, found "1e3"; drop the quotes'),
        ("axes.height = 3.0", "axes.height", "expected a list, found 3.0; write e.g. [1.0, 2.0]"),
        ("axes.height = '1, 2'", "axes.height", 'expected a list, found "1, 2"'),
        ("axes.height.values = 3", "axes.height.values", "expected a list, found 3"),
        ("axes.height = {}", "axes.height", "has neither spacing, values nor file"),
        ("axes.height = { start = 1, stop = 2, num = 3 }", "axes.height", 'write spacing = "linear" or "log"'),
        ("axes.height = { values = [1], file = 'x' }", "axes.height", "values and file exclude each other"),
        ("axes.height = { values = [1], num = 1 }", "axes.height.num", "does not go with values; leave it out"),
        ("axes.height = { spacing = 'log', start = 1, stop = 2 }", "axes.height.num", "missing; write e.g."),
        ("axes.height = { spacing = 'log', num = 2, stop = 2 }", "axes.height.start", "missing; write e.g."),
        (axis("lin", "1", "2", "3"), "axes.height.spacing", '"linear" or "log", found "lin"'),
        (axis("log", "-1", "2", "3"), "axes.height.start", "a log axis needs start > 0"),
        (axis("log", "1", "0", "3"), "axes.height.stop", "a log axis needs stop > 0"),
        (axis("linear", "nan", "2", "3"), "axes.height.start", "finite number, found nan"),
        (axis("linear", "1", "inf", "3"), "axes.height.stop", "finite number, found inf"),
        (axis("linear", "1", "1", "3"), "axes.height.stop", "equals start"),
        (axis("linear", "1", "2", "1"), "axes.height.num", "expected at least 2, found 1"),
        (axis("linear", "1", "2", "-5"), "axes.height.num", "at least 2, found -5"),
        (axis("linear", "1", "2", "3.0"), "axes.height.num", "a whole number, found 3.0"),
        (axis("linear", "1", "2", "true"), "axes.height.num", "whole number, found true"),
        (
            axis("linear", "1", "2", "10_000_001"),
            "axes.height.num",
            "expected at most 10000000, found 10000001",
        ),
        (
            "axes.height = { spacing = 'log', start = 1e300, stop = 1e308, num = 3, unit = 'km' }",
            "axes.height",
            "leaves the range of float64",
        ),
        ("axes.height = { values = [1], unit = 3 }", "axes.height.unit", "expected text in quotes, found 3"),
        ("axes.height = { values = [1], unit = 'furlongs2' }", "axes.height.unit", "is not a known unit"),
        ("axes.height.file = 3", "axes.height.file", "expected the name of a csv file, found 3"),
        ("axes.height = [9007199254740993]", "axes.height[0]", "not exact as a float64; write 9007199254740992.0"),
        (f"axes.height = [1{'0' * 400}]", "axes.height[0]", "digits is larger than any float64"),
        ("axes.rtol = [1e-3, 1]\nfixed.height = 1", "axes.rtol", "expected 1e-15 <= rtol < 1 everywhere"),
        ("axes.height = [1]\nrtol = 1e-16", "rtol", "expected 1e-15 <= rtol < 1, found 1e-16"),
        ("axes.height = [1]\nrtol = 1", "rtol", "expected 1e-15 <= rtol < 1, found 1"),
        ("axes.height = [1]\nrtol = nan", "rtol", "expected 1e-15 <= rtol < 1, found nan"),
        ("axes.height = [1]\nrtol = '1e-3'", "rtol", "drop the quotes"),
        ("axes.height = [1]\naxes.rtol = [1e-3]\nrtol = 1e-3", "rtol", "rtol is an axis as well"),
        ("axes.height = [1]\naxes.method = ['auto']\nmethod = 'auto'", "method", "method is an axis as well"),
        ("axes.height = [1]\nmethod = 3", "method", 'expected "auto", "rough" or "exact", found 3'),
        ("axes.height = [1]\ndesign = 'sobo'", "design", "did you mean sobol?"),
        ("axes.height = { spacing = 'log', start = 1, stop = 2 }\ndesign = 'sobol'", "design", "how many points?"),
        ("axes.height = [1]\ntitle = 3", "title", "expected text in quotes, found 3"),
        ("axes.height = [1]\nfixed = [3]", "fixed", "expected a table, found a list"),
        ("axes.height = [1]\nfixed.height = 1", "fixed.height", "height is an axis as well; keep one of the two"),
        ("axes.height = [1]\nfixed.g = [1, 2]", "fixed.g", "found a list; to sweep it, write it under [axes.g]"),
        ("axes.height = [1]\nfixed.g = { value = [1], unit = 'm/s^2' }", "fixed.g.value", "write it under [axes.g]"),
        ("axes.height = [1]\nfixed.g = {}", "fixed.g.value", "expected a number, found nothing"),
        ("axes.height = [1]\nfixed.g = '9.81 m/s^2'", "fixed.g", 'write { value = 9.81, unit = "m/s^2" }'),
        ("axes.height = [1]\nfixed.g = false", "fixed.g", "expected a number, found false"),
        ("axes.height = [1]\nfixed.v0 = -0.5", "fixed.v0", "expected >= 0 m/s, found -0.5 m/s"),
        ("axes.height = [1]\nfixed.g = { value = 0, unit = 'km/s^2' }", "fixed.g", "expected > 0 m/s^2, found 0 m/s^2"),
        ("axes.height = [1]\nfixed.g = nan", "fixed.g", "expected > 0 m/s^2, found nan m/s^2"),
        ("axes.height = [1]\nfixed.G = 1", "fixed.G", "no such parameter; did you mean g?"),
        ("axes.height = [1]\nfixed.quality = 1", "fixed.quality", "no such parameter; it has height, v0 and g"),
        ("axes.height = [1]\nfixed.method = 'exact'", "fixed.method", "stands at the top of a study: method = ..."),
        ("axes.height = [1]\nalong.phase = [0, 2]", "along.phase", "expected values from 0 to 1, found 2"),
        ("axes.height = [1]\nalong.phase = [0, nan]", "along.phase", "expected values from 0 to 1, found nan"),
        ("axes.height = [1]\nalong.phase.num = 1", "along.phase.num", "expected at least 2, found 1"),
        ("axes.height = [1]\nalong.radius.num = 5", "along.radius", "kernel toy has no such coordinate; it has phase"),
        ('design = "zip"\naxes.height = [1, 2]\naxes.v0 = [1, 2, 3]', "axes", "height has 2 and v0 has 3 values"),
    ],
)
def test_a_mistake_is_told_with_where_and_what_to_do(mistakes, text, where, message):
    found = mistakes(text)
    assert message in found[where]
    assert len(found) == 1, found


@pytest.mark.parametrize(
    "text",
    [
        "kernel = 'folio'\naxes.method = ['closed', 'map']",
        "kernel = 'toy:KERNEL'\naxes.method = ['rough', 'exact']",  # not allowed, so not known
        "kernel = 'foliot'\naxes.mode = ['a', 'b']\nfixed = { mu = 1, a = 1, phi0 = 1 }",
    ],
)
def test_words_of_what_is_not_known_do_not_repeat_each_other(mistakes, text):
    found = mistakes(text, head="", allow_import=False)
    assert [where for where in found if where.startswith("axes")] == ["axes.mode"] * ("axes.mode" in text)


@pytest.mark.parametrize(("flips", "good"), [(1, True), (2.5, False), (0, False), (1e300, False)])
def test_a_fixed_number_that_is_to_be_whole_is(mistakes, read, flips, good):
    text = f"kernel = 'foliot_steps'\naxes.mu = [1]\nfixed = {{ a = 1, phi0 = 1, step = 0.1, flips = {flips} }}"
    if good:
        assert read(text, head="").fixed["flips"] == flips
    else:
        assert "expected a whole number >= 1, <= " in mistakes(text, head="")["fixed.flips"]


@pytest.mark.parametrize(
    ("outputs", "where", "message"),
    [
        ("[]", "outputs", "expected a list of outputs, found an empty list; leave it out to get all of them"),
        ("'fall_time'", "outputs", 'expected a list of outputs, found "fall_time"'),
        ("['fall_time', 'fall_time']", "outputs[1]", '"fall_time" stands twice'),
        ("['fall_time', 3]", "outputs[1]", "found 3"),
    ],
)
def test_outputs_are_checked(mistakes, outputs, where, message):
    found = mistakes(f'kernel = "toy:KERNEL"\noutputs = {outputs}\naxes.height = [1]', head="")
    assert message in found[where]


def test_a_coordinate_of_a_kernel_that_has_none_is_left_out():
    assert message_of(lambda: build_rich(along={"phase": {"num": 3}}), "along.phase") == (
        "kernel rich has no such coordinate; leave it out"
    )


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


# kernels


def test_an_unknown_kernel_is_told_with_the_catalogue_and_all_else_that_is_wrong(mistakes):
    found = mistakes('kernel = "folio"\nmehtod = "auto"\naxes.mu = ["1"]\naxes.a.num = 0.5\nfixed.b = true', head="")
    assert found["kernel"].startswith('no kernel "folio"; did you mean foliot? there are foliot')
    assert found["mehtod"] == "no such key; did you mean method?"
    assert {"axes.a", "fixed.b"} < found.keys()


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


def test_a_missing_kernel_is_a_mistake(mistakes):
    assert mistakes("axes.height = [1]", head="")["kernel"] == 'missing; write e.g. kernel = "foliot"'


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


def test_an_endless_file_is_refused(tmp_path):
    with pytest.raises(sweep.SweepError, match="is no regular file"):
        sweep.study("/dev/zero")
    long = tmp_path / "long.toml"
    long.write_bytes(b"#" * 50_000_001)
    with pytest.raises(sweep.SweepError, match="is larger than 50000000 bytes"):
        sweep.study(long)


def test_windows_line_ends_and_a_byte_order_mark_do_no_harm(tmp_path):
    path = tmp_path / "s.toml"
    path.write_bytes(b"\xef\xbb\xbf# Why?\r\n" + HEAD.replace("\n", "\r\n").encode() + b"axes.height = [1]\r\n")
    assert sweep.study(path, allow_import=True).question == "Why?"


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
