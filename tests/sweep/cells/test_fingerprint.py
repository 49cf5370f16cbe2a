"""The fingerprint changes with everything that decides a number of a result, and with nothing else."""

import sys

import numpy as np
import pytest
from toy_studies import build, build_rich

import sweep
from sweep.cells import fingerprint as module
from sweep.cells.fingerprint import difference, fingerprint
from sweep.study.model import Study

BASE = {"axes": {"height": [1.0, 2.0], "v0": [0.0, 1.0]}}


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"method": "exact"}, "method: was auto, now exact"),
        ({"rtol": 1e-8}, "rtol: was 1e-09, now 1e-08"),
        ({"outputs": ["impact_speed"]}, "outputs: was fall_time, now impact_speed"),
        ({"design": "zip"}, "design: was product, now zip"),
        ({"axes": {"v0": [0.0, 1.0], "height": [1.0, 2.0]}}, "axes: was height, v0, now v0, height"),
        ({"axes": {"height": [1.0, 2.0]}}, "axes.v0: gone, was 2 values, 0 to 1"),
        ({"fixed": {"g": np.nextafter(9.80665, 10)}}, "fixed.g: was 9.80665, now 9.806650000000001"),
        ({"axes": {"height": [1.0, np.nextafter(2.0, 3)], "v0": [0.0, 1.0]}}, "axes.height: was 2 values, 1 to 2"),
        ({"axes": {"height": [1.0, 2.0], "v0": [-0.0, 1.0]}}, "axes.v0: was 2 values, 0 to 1 (digest"),
        ({"outputs": ["drop"], "along": {"phase": [0.0, 1.0]}}, "along.phase: new, 2 values, 0 to 1"),
    ],
)  # fmt: skip
def test_whatever_decides_a_value_changes_the_fingerprint_and_is_named(change, named):
    old, new = fingerprint(build(**BASE)), fingerprint(build(**{**BASE, **change}))
    assert old["study"] != new["study"]
    assert any(line.startswith(named) for line in difference(old, new)), difference(old, new)


def test_words_and_ways_of_writing_do_not_change_it():
    old = fingerprint(build(**BASE))
    spaced = {"height": {"spacing": "linear", "start": 1000, "stop": 2000, "num": 2, "unit": "mm"}, "v0": [0, 1]}
    new = fingerprint(build(axes=spaced, title="Stones", question="Why?", along={"phase": {"num": 9}}))
    assert old == new
    assert difference(old, new) == []


def test_it_survives_json():
    study = build(axes={"height": [np.nan, 1.0, -np.inf, -0.0], "g": [-np.nan]})
    assert fingerprint(Study.from_json(study.to_json(), declared=True)) == fingerprint(study)


def test_a_negative_nan_is_the_same_nan():
    assert fingerprint(build(axes={"height": [-np.nan]})) == fingerprint(build(axes={"height": [np.nan]}))


def test_a_follower_is_told_apart_from_a_fixed_value():
    follows = fingerprint(build_rich())
    assert follows["fixed.hold"] == "as load"
    assert "fixed.hold: was as load, now 1.0" in difference(follows, fingerprint(build_rich(fixed={"hold": 1.0})))


def test_the_versions_of_compiler_and_arrays_are_in_it():
    found = fingerprint(build(**BASE))
    assert found["numpy"] == np.__version__
    assert {"numba", "llvmlite"} < found.keys()


# sources

WRITER = '''
from importlib import import_module

TEXT = """
import math, ownscenes.listed
from ownscenes import (
    inlaid,
)
from {module} import *
"""


def deep():
    return import_module("ownscenes.called"), import_module(".beside", __package__)
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A kernel in a package of its own, with modules it imports in several ways, and one it does not."""
    folder = tmp_path / "ownscenes"
    (folder / "deep").mkdir(parents=True)
    texts = {
        "__init__.py": "",
        "scene.py": "from . import waves\nfrom .deep.far import far\nimport ownscenes.plain\nfrom toy import KERNEL\n"
        "from . import writer\n",
        "writer.py": WRITER,
        "called.py": "",
        "beside.py": "",
        "listed.py": "",
        "inlaid.py": "",
        "waves.py": "def lazy():\n    from ownscenes import late\n",
        "late.py": "import math, numpy, json\n",
        "plain.py": "",
        "unused.py": "",
        "deep/__init__.py": "from . import near\n",
        "deep/far.py": "from .. import upper\nfar = 1\n",
        "deep/near.py": "",
        "upper.py": "from ownscenes.scene import KERNEL\n",
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    (folder / "upper.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "ownscenes"]:
        del sys.modules[name]


def sources(found):
    return {name.removeprefix("source ") for name in found if name.startswith("source ")}


def test_every_module_of_the_package_that_the_kernel_imports_counts(package):
    found = fingerprint(build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0]}))
    own = {name for name in sources(found) if name.startswith("ownscenes")}
    assert own == {
        "ownscenes",
        "ownscenes.scene",
        "ownscenes.waves",
        "ownscenes.late",
        "ownscenes.plain",
        "ownscenes.deep.far",
        "ownscenes.deep",
        "ownscenes.deep.near",
        "ownscenes.upper",
        "ownscenes.writer",
        "ownscenes.called",
        "ownscenes.beside",
        "ownscenes.listed",
        "ownscenes.inlaid",
    }


@pytest.mark.parametrize(
    "name", ["scene", "waves", "late", "plain", "deep.far", "deep.near", "upper", "called", "inlaid"]
)
def test_an_edit_of_any_of_them_is_named(package, name):
    study = build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0]})
    old = fingerprint(study)
    path = package / (name.replace(".", "/") + ".py")
    path.write_text(path.read_text() + "# edited\n")
    new = fingerprint(study)
    assert difference(old, new) == [f"source ownscenes.{name}: changed"]


def test_an_edit_of_a_module_that_is_not_imported_changes_nothing(package):
    study = build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0]})
    old = fingerprint(study)
    (package / "unused.py").write_text("edited = True\n")
    assert fingerprint(study) == old


def test_our_own_modules_count_for_a_kernel_of_another_package():
    assert {"toy", "kernels.interface"} < sources(fingerprint(build(**BASE)))


def test_the_foliot_counts_all_it_is_made_of_and_nothing_of_numpy():
    study = sweep.study(kernel="foliot", axes={"mu": [1.0]}, fixed={"phi0": 1.0, "a": 1.0})
    found = sources(fingerprint(study))
    assert {"kernels.foliot.cycle", "kernels.lanes.vectors", "kernels.maths.elementary", "kernels.interface"} <= found
    assert all(name.partition(".")[0] in ("kernels", "sweep") for name in found)


def of_the_engine(study):
    return {name for name in sources(fingerprint(study)) if name.startswith("sweep.")}


def test_what_chooses_methods_and_what_reduces_cells_counts_too():
    cells = {"sweep.cells.solve", "sweep.cells.turns", "sweep.cells.grid"}
    assert of_the_engine(build(**BASE)) == cells
    assert of_the_engine(build(**BASE, summary={})) == cells | {
        "sweep.cells.partition",
        "sweep.cells.reduce",
        "sweep.cells.output_schema",
    }


@pytest.mark.parametrize("name", ["solve", "turns", "grid", "partition", "reduce", "output_schema"])
def test_an_edit_of_what_reduces_cells_is_named(monkeypatch, tmp_path, name):
    study = build(**BASE, summary={})
    old, real = fingerprint(study), module._path
    edited = tmp_path / f"{name}.py"
    edited.write_bytes(real(f"sweep.cells.{name}").read_bytes() + b"# edited\n")
    monkeypatch.setattr(module, "_path", lambda asked: edited if asked == f"sweep.cells.{name}" else real(asked))
    assert difference(old, fingerprint(study)) == [f"source sweep.cells.{name}: changed"]


def test_a_kernel_typed_at_the_prompt_has_no_source_and_is_no_fault(monkeypatch):
    monkeypatch.setattr(sys.modules["__main__"], "OWN", build(**BASE).kernel, raising=False)
    assert fingerprint(build(kernel="__main__:OWN", axes={"height": [1.0]}))["kernel"] == "__main__:OWN"


# differences


def test_a_new_version_is_told_with_both():
    assert difference({"numba": "0.67"}, {"numba": "0.68"}) == ["numba: was 0.67, now 0.68"]


def test_a_source_that_came_or_went_is_told_without_digests():
    assert difference({"source a": "1", "source b": "2"}, {"source b": "3", "source c": "4"}) == [
        "source b: changed",
        "source c: new",
        "source a: gone",
    ]


def test_many_sources_are_told_in_one_line():
    many = {f"source {k}": "1" for k in range(9)}
    eight = {name: many[name] for name in list(many)[:8]}
    assert difference({}, eight) == [f"{name}: new" for name in eight]
    assert difference({}, many) == ["source of 9 modules: 9 new"]
    others = {**dict.fromkeys(eight, "2"), "source b": "1", "source c": "1", "rtol": "3"}
    assert difference({"rtol": "2", **many}, others) == [
        "rtol: was 2, now 3", "source of 11 modules: 2 new, 8 changed, 1 gone",
    ]  # fmt: skip


def test_the_digest_of_the_study_is_told_only_where_nothing_else_differs():
    assert difference({"study": "1", "rtol": "a"}, {"study": "2", "rtol": "b"}) == ["rtol: was a, now b"]
    assert difference({"study": "1"}, {"study": "2"}) == ["study: changed"]


def test_a_module_beside_the_kernel_counts(tmp_path, monkeypatch):
    (tmp_path / "lonely_scene.py").write_text("import lonely_helper\nfrom toy import KERNEL\n")
    (tmp_path / "lonely_helper.py").write_text("FACTOR = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    study = build(kernel="lonely_scene:KERNEL", axes={"height": [1.0]})
    old = fingerprint(study)
    (tmp_path / "lonely_helper.py").write_text("FACTOR = 2 \n")
    assert difference(old, fingerprint(study)) == ["source lonely_helper: changed"]
