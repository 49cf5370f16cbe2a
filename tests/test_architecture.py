"""What ARCHITECTURE.md says is so: its picture, what importing the packages costs, and which room uses which."""

import ast
import functools
import graphlib
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import draw_rooms
import pytest

import kernels
import sweep

ROOT = Path(__file__).parent.parent


def test_the_picture_shows_the_rooms_and_imports_of_today():
    assert draw_rooms.PICTURE.read_text(encoding="utf-8") == draw_rooms.draw(), "run: python docs/draw_rooms.py"
    for package in draw_rooms.PACKAGES:
        rooms = {path.stem for path in (ROOT / package).iterdir() if not path.name.startswith("_")}
        named = {name.partition(".")[2] for level in draw_rooms.floors(package) for name in level}
        assert rooms == named | {name.partition(".")[2] for name in draw_rooms.CONTRACT if name.startswith(package)}


def test_the_packages_tested_are_this_checkout():
    for package in (kernels, sweep):
        assert Path(package.__file__).is_relative_to(ROOT)


@pytest.mark.parametrize(
    ("code", "unneeded"),
    [
        ("import sweep, sweep.cli", "numba xarray pint numpy h5py dask matplotlib"),
        ("import contextlib, sweep.cli\nwith contextlib.suppress(SystemExit): sweep.cli.main(['--help'])",
         "numba xarray pint numpy h5py dask matplotlib"),
        ("import kernels.interface, kernels.catalogue", "numba"),
        ("import sweep\nsweep.study(kernel='foliot', axes={'mu': [1.0]}, fixed={'a': 1.0, 'phi0': 1.0})",
         "pint xarray"),
        # what says how a run ended is read from the file; their import takes longer than all else of a small run
        ("import sweep.cli\nassert sweep.cli.main(['run', 'study.toml', '-o', 'out.h5']) == 0",
         "xarray pandas pint dask"),
    ],
    ids=["import", "help", "contract", "study", "run"],
)  # fmt: skip
def test_nothing_is_imported_before_it_is_needed(tmp_path, code, unneeded):
    (tmp_path / "study.toml").write_text(
        'kernel = "foliot"\n[axes]\nmu = [1.0, 2.0, nan]\n[fixed]\na = 1.0\nphi0 = { value = 60, unit = "degree" }\n'
    )
    script = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{code}\nprint(*{{m.partition('.')[0] for m in sys.modules}})"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert set(done.stdout.splitlines()[-1].split()).isdisjoint(unneeded.split())


# imports: contracts of import-linter know no names of modules, so the sources are walked here


def stated(source, package):
    """Dotted names in the import statements of a source, wherever they stand."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            yield from (".".join(filter(None, [base, node.module, alias.name])) for alias in node.names)


def imported(source, package):
    """Dotted names that a source imports, also in the texts that it writes modules from."""
    yield from stated(source, package)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from re.findall(r"\b(?:kernels|sweep)(?:\.\w+)+", node.value)


@functools.cache
def file_of(name):
    """The file of a module, or of the one that a name is in; None of other packages."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:end])
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file():
                return file
    return None


def imports_of(top, names):
    """Which files each file of a package imports, lazily and for types alone, too."""
    found = {}
    for file in Path(top.__file__).parent.rglob("*.py"):
        package = list(file.relative_to(ROOT).parent.parts)
        found[file] = {file_of(name) for name in names(file.read_text("utf-8"), package)} - {None, file}
    assert sum(map(len, found.values())) > len(found)
    return found


def room(file):
    return file.relative_to(ROOT).with_suffix("").parts[1]


@pytest.mark.parametrize("top", [kernels, sweep])
def test_no_room_reaches_for_the_private_modules_of_another_and_no_file_imports_itself_by_way_of_others(top):
    for file, others in imports_of(top, imported).items():
        private = [other for other in others if re.match("_[^_]", other.stem) or re.match("_[^_]", room(other))]
        assert [other for other in private if room(other) != room(file)] == [], file
    imports = imports_of(top, stated)
    imports.pop(Path(top.__file__))  # the public names of the package itself are for users
    try:
        graphlib.TopologicalSorter(imports).prepare()
    except graphlib.CycleError as circle:
        pytest.fail(" <- ".join(str(file.relative_to(ROOT)) for file in circle.args[1]))


def test_a_room_says_which_of_its_modules_others_may_use():
    imports = imports_of(sweep, imported)
    used = {other for file, others in imports.items() for other in others if room(other) != room(file)}
    used = {file for file in used if file.stem != "__init__" and len(file.relative_to(ROOT).parts) == 3}
    assert len(used) > 20
    doc = {room(file): import_module(f"sweep.{room(file)}").__doc__ for file in used if file.parts[-3] == "sweep"}
    assert sorted(str(f) for f in used if f.parts[-3] == "sweep" and f"`{f.stem}`" not in doc[room(f)]) == []
