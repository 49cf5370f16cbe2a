"""What a user is told of everything wrong in a study."""

import numpy as np
import pytest
from toy_studies import build, message_of

import sweep


@pytest.mark.parametrize(
    ("text", "where", "word"),
    [
        ("fixed.height = 1", "axes", "missing"), ("[axes]\n[fixed]\nheight = 1", "axes", ""),
        ("axes.v0 = [1.0]", "fixed.height", "has no default"), ("axes.height = []", "axes.height", "no values"),
        ("axes.height = [1, 2, 1.0]", "axes.height", "1 occurs"),
        ("axes.height = [1, nan, 2, nan]", "axes.height", "nan"),
        ("axes.method = ['auto', 'auto']\nfixed.height = 1", "axes.method", "auto occurs"),
        ("axes.height = {}", "axes.height", "neither"),
        ("axes.height = { values = [1], file = 'x' }", "axes.height", "exclude each other"),
        ("axes.height = { values = [1], num = 1 }", "axes.height.num", "with values"),
        ("axes.height = { spacing = 'linear', start = nan, stop = 2, num = 3 }", "axes.height.start", "finite"),
        ("axes.height = { spacing = 'linear', start = 1, stop = inf, num = 3 }", "axes.height.stop", "finite"),
        ("axes.height = { spacing = 'linear', start = 1, stop = 1, num = 3 }", "axes.height.stop", "values = [1]"),
        ("axes.height = { spacing = 'log', start = 1e300, stop = 1e308, num = 3, unit = 'km' }", "axes.height", "64"),
        ("axes.height = { spacing = 'log', start = 1e-320, stop = 1, num = 3, unit = 'nm' }", "axes.height", "range"),
        ("axes.height = [9007199254740993]", "axes.height[0]", "not exact"),
        (f"axes.height = [1{'0' * 400}]", "axes.height[0]", "larger than any"),
        ("axes.height = [1]\naxes.rtol = [1e-3]\nrtol = 1e-3", "rtol", "an axis as well"),
        ("axes.height = [1]\naxes.method = ['auto']\nmethod = 'auto'", "method", "an axis as well"),
        ("axes.height = { spacing = 'log', start = 1, stop = 2 }\ndesign = 'sobol'", "design", "how many"),
        ("axes.height = [1]\nfixed.height = 1", "fixed.height", "an axis as well"),
        ("axes.height = [1]\nfixed.g = [1, 2]", "fixed.g", "[axes.g]"),
        ("axes.height = [1]\nfixed.g = { value = [1], unit = 'm/s^2' }", "fixed.g.value", "[axes.g]"),
        ("axes.height = [1]\nfixed.quality = 1", "fixed.quality", "height, v0 and g"),
        ("axes.height = [1]\nfixed.rtol = 1", "fixed.rtol", "at the top"),
        ("axes.height = [1]\nalong.phase = [0, 2]", "along.phase", ">= 0, <= 1"),
        ("axes.height = [1]\nalong.r.num = 5", "along.r", "it has phase"),
        ('title = "a\\u0000b"\naxes.height = [1]', "title", "leave it out"),
        ('design = "zip"\naxes.height = [1, 2]\naxes.v0 = [1, 2, 3]', "axes", "equal length"),
    ],
)  # fmt: skip
def test_what_does_not_fit_together_is_told_where_it_stands(mistakes, text, where, word):
    found = mistakes(text)
    assert list(found) == [where]
    assert word in found[where]


def test_of_many_bad_values_three_are_told_and_the_others_counted(mistakes):
    found = mistakes("axes.height = ['a', 1, 'b', 'c', 'd', 'e']")
    assert list(found) == ["axes.height[0]", "axes.height[2]", "axes.height[3]", "axes.height"]
    assert "2 more" in found["axes.height"]


def test_a_misspelt_name_is_checked_as_the_one_that_is_meant():
    with pytest.raises(sweep.StudyError) as caught:
        sweep.study(kernel="folio", axes={"m_u": {"values": [1.0], "unit": "kg"}}, fixed={"phi_0": -1.0, "a": 1.0})
    told = [m.where for m in caught.value.mistakes]
    assert told == ["kernel", "axes.m_u", "axes.m_u.unit", "fixed.phi_0", "fixed.phi_0"]
    with pytest.raises(sweep.StudyError, match=r'over\[0\] +expected "mu" or "q", found "nu"'):
        sweep.study(kernel="foliot", axes={"mu": [1.0], "q": [1.0]}, summary={"over": ["nu"]})


def test_too_many_values_or_cells_are_refused_before_memory_is_asked_for(mistakes):
    axis = '{{ spacing = "linear", start = 1, stop = 2, num = {} }}'
    found = mistakes("\n".join(f"axes.{name} = {axis.format(10**7)}" for name in ("height", "v0", "g")))
    assert "at most 1e+12" in found["axes"]
    assert "more than 40 digits" in mistakes(f"axes.height = {axis.format(10**99)}")["axes.height.num"]
    assert "10000001" in message_of(lambda: build(axes={"height": range(10_000_001)}), "axes.height")


@pytest.mark.parametrize(
    "values", [(1, 2.5), np.array([1.0, 2.5], np.float32), [np.int8(1), 2.5], [np.array(1.0), 2.5]]
)
def test_lists_of_numbers_of_any_kind_are_taken(values):
    assert build(axes={"height": values}).axes["height"].values.tolist() == [1.0, 2.5]


@pytest.mark.parametrize(
    ("values", "where"),
    [
        (np.ones((2, 2)), "axes.height[0]"), (np.array([True]), "axes.height[0]"), (np.array(3.0), "axes.height"),
        (None, "axes.height"), (["1"], "axes.height[0]"), ([1j], "axes.height[0]"), ({1.0, 2.0}, "axes.height"),
        (np.array([2**60 + 1]), "axes.height[0]"),
    ],
)  # fmt: skip
def test_arrays_that_are_no_list_of_numbers_are_refused(values, where):
    assert message_of(lambda: build(axes={"height": values}), where)


ROWS = {"kernel": "beads:KERNEL", "design": "zip"}
SPACED = {"spacing": "linear", "start": 1.0, "stop": 2.0}
MASS = [0.1, 0.2, 0.7]
BEADS = {"kernel": "beads:KERNEL", "axes": {"g": [1.0]}}


@pytest.mark.parametrize(
    ("keys", "where", "word"),
    [
        ({**BEADS, "fixed": {"mass": 1.0}}, "fixed", "how many of bead"),
        ({**BEADS, "fixed": {"mass": MASS, "place": [1.0, 2.0]}}, "fixed", "place has 2"),
        ({**BEADS, "fixed": {"mass": []}}, "fixed.mass", "no values"),
        ({**BEADS, "fixed": {"mass": {"value": [1.0], "file": "rod.csv"}}}, "fixed.mass", ""),
        ({**BEADS, "fixed": {"mass": MASS}, "method": "quick"}, "method", "quick does not give share"),
        ({**BEADS, "axes": {"mass": [MASS, MASS]}}, "axes.mass", 'design = "zip"'),
        ({**ROWS, "axes": {"mass": [MASS, MASS[:2]]}}, "axes.mass", "equal length"),
        ({**ROWS, "axes": {"mass": [[1.0], 2.0]}}, "axes.mass", "list of lists"),
        ({**ROWS, "axes": {"mass": {**SPACED, "num": 3}}}, "axes.mass.spacing", ""),
        ({**ROWS, "axes": {"mass": np.ones((0, 2))}}, "axes.mass", ""),
        ({**ROWS, "design": {"kind": "sobol", "n": 4}, "fixed": {"mass": [1.0]}, "axes": {"place": SPACED}},
         "axes.place", ""),
        ({"kernel": "toy:RICH", "axes": {"load": [1.0]}, "fixed": {"shape": {"value": "round", "unit": "m"}}},
         "fixed.shape.unit", ""),
        ({"kernel": "toy:RICH", "axes": {"load": [1.0], "shape": {**SPACED, "num": 2}}}, "axes.shape", ""),
    ],
)  # fmt: skip
def test_what_an_array_or_a_word_cannot_be_is_told(keys, where, word):
    assert word in message_of(lambda: sweep.study(keys, allow_import=True), where)


@pytest.mark.parametrize("edges", [[1.0], [1.0, 1.0], [2.0, 1.0], [1.0, np.inf]])
def test_edges_of_a_histogram_rise(edges):
    summary = {"outputs": {"fall_time": ["histogram"]}, "edges": {"fall_time": edges}}
    assert message_of(lambda: build(axes={"height": [1.0]}, summary=summary), "summary.edges.fall_time")


@pytest.mark.parametrize(
    ("kernel", "message"),
    [
        ('"toy:KERNELL"', "no attribute 'KERNELL'"), ('"no_such_module:K"', "ModuleNotFoundError"),
        ('"toy:check"', "is a function"), ('":"', "cannot be loaded"), ("3", "there are foliot"),
        ('""', "expected the name of a kernel"),
    ],
)  # fmt: skip
def test_a_kernel_that_cannot_be_had_is_a_mistake(mistakes, kernel, message):
    assert message in mistakes(f"kernel = {kernel}\naxes.height = [1]", head="")["kernel"]


@pytest.mark.parametrize(
    ("source", "said"), [("1 / 0", "ZeroDivisionError"), ("raise SystemExit('licence')", "licence")]
)
def test_a_module_of_ones_own_is_imported_only_if_allowed_and_its_fault_told_in_one_line(
    mistakes, tmp_path, source, said
):
    name = f"broken_kernel_{len(source)}"
    (tmp_path / f"{name}.py").write_text(source)
    study = f'kernel = "{name}:KERNEL"\naxes.height = [1]'
    assert "allow it with --allow-import" in mistakes(study, head="", allow_import=False)["kernel"]
    found = mistakes(study, head="")["kernel"]
    assert said in found
    assert "\n" not in found


# files that are no study


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("a = = 3", "line 1"), ("a = 1\nb = 2\na = 3\n", "line 3"), ("[axes.mu]\nnum = 1\n[axes.mu]\n", "line 3"),
        ("a = 'x", "end of file"), ("a = [1, 2", "end of file"), ("a = " + "1" * 5000, "file"),
        ("a = " + "[" * 50_000, "file"),
    ],
)  # fmt: skip
def test_toml_that_cannot_be_read_is_told_by_line(mistakes, text, where):
    assert list(mistakes(text, head="")) == [where]


def test_what_is_no_study_is_refused_in_one_line_that_names_the_way(tmp_path):
    path = tmp_path / "foliot_scaling.toml"
    contents = {b"": "is empty", b" \n\n": "is empty", b"\x89HDF\r\n\x1a\n\x00": "byte 0", b"title = '\xe4'": "byte 9"}
    for name, (content, _) in enumerate(contents.items()):
        (tmp_path / f"{name}.toml").write_bytes(content)
    path.touch()
    for given, message in (
        (None, "give one"), (3, "found 3"), ("a = 1\nb = 2", "is the text of a study"), ("a.h5", "sweep show a.h5"),
        ("a.py", "python a.py"), ("nowhere.toml", "no such file"), ("/dev/zero", "not a file"),
        ("\0.toml", "cannot be read"), (tmp_path, "a folder"),
        (tmp_path / "foliot_scalling.toml", "did you mean foliot_scaling.toml?"),
        *((tmp_path / f"{name}.toml", message) for name, message in enumerate(contents.values())),
    ):  # fmt: skip
        with pytest.raises(sweep.SweepError) as caught:
            sweep.study(given)
        assert "\n" not in str(caught.value)
        assert message in str(caught.value)
    study = build(axes={"height": [1.0]})
    for keys, message in (({"workes": 2}, "did you mean workers?"), ({"rtol": 1e-3}, "do not go with a study")):
        with pytest.raises(sweep.SweepError, match=message):
            sweep.run(*([study] if "rtol" in keys else []), **keys)
    with pytest.raises(sweep.SweepError, match="expected a Study"):
        sweep.to_toml({})
