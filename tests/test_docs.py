"""Pages say what is so, as far as can be told without building the site; what they run is run."""

import ast
import inspect
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import sweep
from sweep.cli import parser

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if not {"_build", "_made"} & set(path.relative_to(DOCS).parts))


def text(name):
    return (DOCS / name).read_text(encoding="utf-8")


def test_every_public_name_has_its_place_in_the_reference():
    named = re.findall(r"auto(?:function|exception):: (?:[\w.]+\.)?(\w+)", text("api.md"))
    assert sorted(named) == sorted(sweep.__all__)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_links_of_a_page_lead_to_files_that_are_there_and_its_python_parses(page):
    made = {"gallery.md", "commands.md", "index.md"}
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists() or ("_made" in target and Path(target).name in made), target
    for code in re.findall(r"```(?:\{code-cell\} )?python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        if not code.startswith(">>>"):  # a doctest is run by a test of its own
            ast.parse("\n".join(line for line in code.splitlines() if not line.startswith(("%", ":"))))


THEORY = [page for page in PAGES if page.parent.name == "theory" and "code-cell" in page.read_text(encoding="utf-8")]


@pytest.mark.parametrize("page", THEORY, ids=lambda path: path.stem)
def test_formulas_of_a_page_of_theory_agree_with_the_kernels(page, monkeypatch):
    """Its cells are evaluated, and say so by assertions of their own."""
    monkeypatch.chdir(page.parent)
    cells = re.findall(r"```\{code-cell\} python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    code = "\n".join(line for cell in cells for line in cell.splitlines() if not line.startswith(("%", ":")))
    assert "assert " in code
    exec(compile(code, page, "exec"), {"__name__": page.stem})


def test_pages_of_kernels_say_what_the_kernels_declare():
    make_pages = pytest.importorskip("make_pages")
    page = "\n".join(make_pages._kernel_page("foliot", None))
    kernel = make_pages._kernel("foliot")
    for field in (*kernel.parameters, *kernel.outputs):
        assert f"| `{field.name}` |" in page
    for method in kernel.methods:
        assert re.search(rf"^\| `{method.name}` \|", page, re.MULTILINE)
    assert "phi'' + a phi' + (R + c abs(phi')^n) sgn phi' + k phi = +-mu" in page


def test_the_readme_fits_on_two_screens_and_tests_as_ci_does():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(readme.splitlines()) <= 80
    (line,) = re.findall(r"^.*-m pytest.*$", readme, re.MULTILINE)
    assert line in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for code in re.findall(r"```python\n(.*?)```", readme, re.DOTALL):
        ast.parse(code)


# the page on many machines


def blocks(language):
    """Code of the page on many machines."""
    return re.findall(rf"```{language}\n(.*?)```", text("many_machines.md"), re.DOTALL)


def test_commands_on_many_machines_are_those_of_the_command_line():
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    (ours,) = (shlex.split(line, comments=True)[1:] for line in lines if line.startswith("sweep "))
    found = parser().parse_args(ours)
    assert found.cluster.startswith("tcp://")
    assert (ROOT / found.study).is_file()


def test_code_for_many_machines_passes_what_dask_takes():
    distributed = pytest.importorskip("distributed")
    calls = [node for block in blocks("python") for node in ast.walk(ast.parse(block)) if isinstance(node, ast.Call)]
    named = {call.func.id: call for call in calls if isinstance(call.func, ast.Name)}
    assert {"Client", "SSHCluster", "SLURMCluster"} <= named.keys()
    taken = inspect.signature(distributed.SSHCluster).parameters
    assert {word.arg for word in named["SSHCluster"].keywords} <= taken.keys()


def test_a_client_of_two_processes_here_gives_the_same_result(tmp_path):
    pytest.importorskip("distributed")
    (code,) = (block for block in blocks("python") if "sweep.run" in block)
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    script = tmp_path / "script.py"
    script.write_text(code)
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, env={**os.environ, "PYTHONPATH": path}, capture_output=True,
        text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    study = sweep.study(ROOT / "studies" / "foliot_scaling.toml")
    with sweep.open_result(tmp_path / "foliot_scaling.h5", strict=True) as found:
        here = sweep.run(study, progress=False)
        for name in here.data_vars:
            assert found[name].values.tobytes() == here[name].values.tobytes()
