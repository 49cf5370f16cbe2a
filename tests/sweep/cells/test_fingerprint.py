"""The fingerprint changes with everything that decides a number of a result, and with nothing else."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from toy_studies import build, build_rich

import sweep
from sweep.cells.fingerprint import difference, fingerprint

ROOT = Path(__file__).parents[3]
BASE = {"axes": {"height": [1.0, 2.0], "v0": [0.0, 1.0]}}


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"method": "exact"}, "method: was auto, now exact"),
        ({"rtol": 1e-8}, "rtol: was 1e-09, now 1e-08"),
        ({"where": "height > 1"}, "where: "),
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
    assert fingerprint(build(axes={"height": [-np.nan]})) == fingerprint(build(axes={"height": [np.nan]}))


def test_a_follower_is_told_apart_from_a_fixed_value():
    follows = fingerprint(build_rich())
    assert follows["fixed.hold"] == "as load"
    assert "fixed.hold: was as load, now 1.0" in difference(follows, fingerprint(build_rich(fixed={"hold": 1.0})))


def test_the_versions_of_compiler_and_arrays_are_in_it():
    found = fingerprint(build(**BASE))
    assert found["numpy"] == np.__version__
    assert {"numba", "llvmlite"} < found.keys()
    assert difference({"numba": "0.67"}, {"numba": "0.68"}) == ["numba: was 0.67, now 0.68"]


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A kernel in a package of its own, which imports a module beside it, and that another one."""
    folder = tmp_path / "ownscenes"
    (folder / "deep").mkdir(parents=True)
    texts = {
        "ownscenes/__init__.py": "",
        "ownscenes/scene.py": "from .deep import far\nfrom toy import KERNEL\nimport json, numpy, ownhelper\n",
        "ownscenes/deep/__init__.py": "",
        "ownscenes/deep/far.py": "",
        "ownscenes/late.py": "",
        "ownhelper.py": "def late():\n    import ownother\n",
        "ownother.py": "",
        "unrelated.py": "",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    forget()


def forget():
    """The next import reads the files again."""
    for name in [name for name in sys.modules if name.partition(".")[0] in ("ownscenes", "ownhelper")]:
        del sys.modules[name]


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ("ownscenes/scene.py", ["source ownscenes: changed"]),
        ("ownscenes/deep/far.py", ["source ownscenes: changed"]),
        ("ownscenes/late.py", ["source ownscenes: changed"]),
        ("ownhelper.py", ["source ownhelper: changed"]),
        ("ownother.py", ["source ownother: changed"]),
        ("unrelated.py", []),
    ],
)
def test_an_edit_of_what_a_kernel_of_ones_own_is_made_of_is_named(package, file, told):
    study = build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0]})
    old = fingerprint(study)
    path = package / file
    path.write_text(path.read_text() + "# edited\n")
    assert fingerprint(study) == old  # numbers still come of what was read before
    if told:
        with pytest.raises(sweep.SweepError, match=f"{told[0]} since the run began"):
            sweep.run(study, isolate=True, progress=False)
    forget()
    study = build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0]})
    assert difference(old, fingerprint(study)) == told


def sources(study):
    return {name.removeprefix("source ") for name in fingerprint(study) if name.startswith("source ")}


def test_the_packages_that_decide_values_are_in_it_and_nothing_that_is_installed(package):
    ours = {"kernels", "sweep.cells", "sweep.study"}
    assert sources(sweep.study(kernel="foliot", axes={"mu": [1.0]}, fixed={"phi0": 1.0, "a": 1.0})) == ours
    own = build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0]})
    assert sources(own) == ours | {"ownscenes", "ownhelper", "ownother", "toy"}


EDITED = """
import os, sys
import sweep
from sweep.cells.fingerprint import fingerprint
for file in ["sweep/edited", *sys.argv[1:]]:
    with open(file, "a") as source:
        source.write("# edited\\n")
    if os.fork() == 0:
        study = sweep.study(kernel="foliot", axes={"mu": [1.0]}, fixed={"phi0": 1.0, "a": 1.0})
        print(sorted(fingerprint(study).items()), flush=True)
        os._exit(0)
    os.wait()
"""


def test_another_version_of_foliot_is_another_program(tmp_path):
    """Sources are read by another process each time, as a user's next run does."""
    for package in ("kernels", "sweep"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    files = ["kernels/foliot/_viscous.py", "sweep/cells/solve.py", "sweep/study/condition.py"]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", EDITED, *files], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert len(set(done.stdout.splitlines())) == len(files) + 1


def test_a_kernel_typed_at_the_prompt_has_no_source_and_is_no_fault(monkeypatch):
    monkeypatch.setattr(sys.modules["__main__"], "OWN", build(**BASE).kernel, raising=False)
    found = fingerprint(build(kernel="__main__:OWN", axes={"height": [1.0]}))
    assert found["kernel"] == "__main__:OWN"


def test_a_fixed_array_counts_whole():
    masses = np.arange(1.0, 3001.0)
    other = masses.copy()
    other[1500] += 1.0
    keys = {"kernel": "beads:KERNEL", "outputs": ["total"], "axes": {"g": [1.0]}}
    one, two = (fingerprint(build(**keys, fixed={"mass": values})) for values in (masses, other))
    assert one["study"] != two["study"]


def test_cells_of_another_version_are_not_extended(package, tmp_path):
    """Another version has another source text, and may give other numbers."""
    output, source = tmp_path / "out.h5", package / "ownscenes" / "scene.py"
    few = build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0, 2.0]})
    sweep.run(few, output, progress=False).close()
    source.write_text(source.read_text() + "# edited\n")
    forget()
    more = build(kernel="ownscenes.scene:KERNEL", axes={"height": [1.0, 1.5, 2.0]})
    before = output.read_bytes()
    with pytest.raises(sweep.SweepError, match="cannot be extended"):
        sweep.run(more, output, progress=False, extend=True)
    assert output.read_bytes() == before
