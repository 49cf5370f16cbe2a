"""The fingerprint changes with everything that decides a number of a result, and with nothing else."""

import sys

import numpy as np
import pytest
from toy_studies import build, build_rich

import sweep
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


def test_an_edit_of_a_module_that_is_not_imported_changes_nothing(package):
    study = build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0]})
    old = fingerprint(study)
    (package / "unused.py").write_text("edited = True\n")
    assert fingerprint(study) == old


def test_our_own_modules_count_for_a_kernel_of_another_package():
    assert {"toy", "kernels.interface"} < sources(fingerprint(build(**BASE)))


def test_a_kernel_typed_at_the_prompt_has_no_source_and_is_no_fault(monkeypatch):
    monkeypatch.setattr(sys.modules["__main__"], "OWN", build(**BASE).kernel, raising=False)
    assert fingerprint(build(kernel="__main__:OWN", axes={"height": [1.0]}))["kernel"] == "__main__:OWN"


# differences


def test_a_fixed_array_counts_whole():
    masses = np.arange(1.0, 3001.0)
    other = masses.copy()
    other[1500] += 1.0
    keys = {"kernel": "beads:KERNEL", "outputs": ["total"], "axes": {"g": [1.0]}}
    one, two = (fingerprint(build(**keys, fixed={"mass": values})) for values in (masses, other))
    assert one["study"] != two["study"]


EDITED = """
from dataclasses import replace
import toy

FACTOR = 1.0
EXACT = toy.KERNEL.method("exact")

def solve(*columns):
    EXACT.solve(*columns)
    columns[-4][...] *= FACTOR

KERNEL = replace(toy.KERNEL, methods=(replace(EXACT, solve=solve, bound=None),))
"""


def test_cells_of_another_version_are_taken_over_where_a_sample_of_them_has_the_same_bits(tmp_path, monkeypatch):
    """Another version has another source text; whether its numbers are the same, a sample of cells tells."""
    (tmp_path / "edited_scene.py").write_text(EDITED)
    monkeypatch.syspath_prepend(tmp_path)
    output = tmp_path / "out.h5"

    def run(heights, **options):
        study = build(kernel="edited_scene:KERNEL", axes={"height": heights})
        return sweep.run(study, output, progress=False, **options)

    run([1.0, 2.0]).close()
    (tmp_path / "edited_scene.py").write_text(EDITED + "# edited\n")
    with run([1.0, 1.5, 2.0], extend=True) as found:
        assert found.attrs["taken_over"].startswith("2 cells of another version")
    (tmp_path / "edited_scene.py").write_text(EDITED + "# edited again\n")
    monkeypatch.setattr(sys.modules["edited_scene"], "FACTOR", 1.0 + 1e-15)
    before = output.read_bytes()
    with pytest.raises(sweep.SweepError, match="cannot be extended"):
        run([1.0, 1.5, 2.0, 3.0], extend=True)
    assert output.read_bytes() == before
