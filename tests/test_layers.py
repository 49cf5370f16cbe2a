"""What the packages are, what importing them costs, and that a room's private modules stay in it."""

import ast
import graphlib
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import kernels
import sweep

ROOT = Path(__file__).parent.parent


def loaded(code):
    """Top-level modules loaded after running `code` in a fresh interpreter."""
    script = f"{code}\nimport sys; print(*sorted({{m.partition('.')[0] for m in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    return set(done.stdout.splitlines()[-1].split())


def test_the_packages_tested_are_this_checkout():
    for package in (kernels, sweep):
        assert Path(package.__file__).is_relative_to(ROOT)


@pytest.mark.parametrize(
    "code",
    [
        "import sweep",
        "import sweep.cli",
        "import contextlib, sweep.cli\nwith contextlib.suppress(SystemExit): sweep.cli.main(['--help'])",
    ],
)
def test_help_is_there_at_once(code):
    assert loaded(code).isdisjoint({"numba", "xarray", "pint", "numpy", "h5py", "dask", "matplotlib"})


def test_the_contract_needs_no_compiler():
    assert "numba" not in loaded("import kernels.interface, kernels.catalogue")


def test_a_study_without_foreign_units_does_without_pint():
    assert "pint" not in loaded(
        "import sweep\nsweep.study(kernel='foliot', axes={'mu': [1.0]}, fixed={'a': 1.0, 'phi0': 1.0})"
    )


def test_a_small_run_to_a_file_needs_neither_xarray_nor_pandas(tmp_path):
    """What says how it ended is read from the file; their import takes longer than all else of a small run."""
    (tmp_path / "study.toml").write_text(
        'kernel = "foliot"\n[axes]\nmu = [1.0, 2.0, nan]\n[fixed]\na = 1.0\nphi0 = { value = 60, unit = "degree" }\n'
    )
    told = loaded(
        f"import sweep.cli\nassert sweep.cli.main(['run', r'{tmp_path}/study.toml', '-o', r'{tmp_path}/out.h5']) == 0"
    )
    assert told.isdisjoint({"xarray", "pandas", "pint", "dask"})
    assert (tmp_path / "out.h5").exists()


# private modules: contracts of import-linter know no names, so the sources are walked here


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


def is_module(parts):
    path = ROOT.joinpath(*parts)
    return path.with_suffix(".py").is_file() or path.is_dir()


def foreign_private(source, package):
    """Private modules of another room than `package`, which is e.g. ["kernels", "foliot"]."""
    for name in imported(source, package):
        parts = name.split(".")
        private = [k for k, part in enumerate(parts) if re.match("_[^_]", part) and is_module(parts[: k + 1])]
        if private and parts[: private[0]][:2] != package[:2]:
            yield ".".join(parts[: private[0] + 1])


PRIVATE = next((ROOT / "kernels" / "foliot").glob("_[a-z]*.py")).stem


@pytest.mark.parametrize(
    "source",
    [
        f"from kernels.foliot.{PRIVATE} import size",
        f"import kernels.foliot.{PRIVATE}",
        f"from kernels.foliot import {PRIVATE}",
        f"from ..foliot.{PRIVATE} import size",
        f"HEAD = 'from kernels.foliot.{PRIVATE} import size'",
    ],
)
def test_a_private_module_of_another_room_is_found(source):
    assert list(foreign_private(source, ["kernels", "wear"])) == [f"kernels.foliot.{PRIVATE}"]
    assert not list(foreign_private(source, ["kernels", "foliot"]))


@pytest.mark.parametrize("top", [kernels, sweep])
def test_no_room_reaches_for_the_private_modules_of_another(top):
    files = list(Path(top.__file__).parent.rglob("*.py"))
    assert len(files) > 50
    rooms = {file: list(file.relative_to(ROOT).parent.parts) for file in files}
    found = {file.name: list(foreign_private(file.read_text("utf-8"), rooms[file])) for file in files}
    assert not {file: names for file, names in found.items() if names}


def file_of(name):
    """The file of a module, or of the one that a name is in; None of other packages."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:end])
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file():
                return file
    return None


def graph(top):
    """Which files each file of a package imports, lazily and for types alone, too."""
    found = {}
    for file in Path(top.__file__).parent.rglob("*.py"):
        names = stated(file.read_text("utf-8"), list(file.relative_to(ROOT).parent.parts))
        found[file] = {file_of(name) for name in names} - {None, file}
    return found


@pytest.mark.parametrize("top", [kernels, sweep])
def test_no_file_imports_itself_by_way_of_others(top):
    imports = graph(top)
    assert sum(map(len, imports.values())) > len(imports)
    # the public names of the package itself are for users
    imports.pop(Path(top.__file__))
    try:
        graphlib.TopologicalSorter(imports).prepare()
    except graphlib.CycleError as circle:
        pytest.fail(" <- ".join(str(file.relative_to(ROOT)) for file in circle.args[1]))


def faces_used():
    """Rooms of the engine, and the modules of each that other rooms import."""
    for file in Path(sweep.__file__).parent.rglob("*.py"):
        package = list(file.relative_to(ROOT).parent.parts)
        for name in imported(file.read_text("utf-8"), package):
            top, room, module, *_ = [*name.split("."), "", ""]
            if top == "sweep" and is_module([top, room, module]) and package[:2] != [top, room]:
                yield room, module


def test_a_room_says_which_of_its_modules_others_may_use():
    used = set(faces_used())
    assert len({room for room, _ in used}) == 11
    doc = {room: import_module(f"sweep.{room}").__doc__ for room, _ in used}
    assert not sorted((room, module) for room, module in used if module and f"`{module}`" not in doc[room])
