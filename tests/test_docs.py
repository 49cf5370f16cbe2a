"""The site is built by its own command; here is what can be told without building it."""

import ast
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import sweep

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if not {"_build", "_made"} & set(path.relative_to(DOCS).parts))


def text(name):
    return (DOCS / name).read_text(encoding="utf-8")


def test_every_public_name_has_its_place_in_the_reference():
    named = re.findall(r"auto(?:function|exception):: (?:[\w.]+\.)?(\w+)", text("api.md"))
    assert sorted(named) == sorted(sweep.__all__)


def test_octave_reads_a_result_as_the_page_says(tmp_path):
    if not shutil.which("octave-cli"):
        pytest.skip("octave is not installed")
    study = sweep.build_study(
        kernel="foliot",
        axes={"mu": {"spacing": "log", "start": 0.1, "stop": 10.0, "num": 7}, "R": [0.0, 0.5, 2.0]},
        fixed={"a": 1.0, "phi0": 1.0},
    )
    sweep.run(study, tmp_path / "result.h5", progress=False).close()
    script = re.search(r"<!-- octave -->\n```matlab\n(.*?)```", text("file_format.md"), re.DOTALL)[1]
    (tmp_path / "script.m").write_text(script)
    done = subprocess.run(
        ["octave-cli", "--norc", "script.m"], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    found = [float(number) for number in done.stdout.split()]
    with sweep.open_result(tmp_path / "result.h5") as dataset:
        at = dataset.period.argmin(...)
        best = dataset.period.isel(at)
        assert found == [float(best), float(best.mu), float(best.R)]
        assert np.isnan(dataset.period.values).any()


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_links_lead_to_files_that_are_there(page):
    made = {"gallery.md", "commands.md", "index.md"}
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists() or ("_made" in target and Path(target).name in made), target


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_its_python_parses(page):
    for code in re.findall(r"```(?:\{code-cell\} )?python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        ast.parse("\n".join(line for line in code.splitlines() if not line.startswith(("%", ":"))))


def test_pages_of_kernels_say_what_the_kernels_declare():
    make_pages = pytest.importorskip("make_pages")
    page = "\n".join(make_pages._kernel_page("foliot", None))
    kernel = make_pages._kernel("foliot")
    for field in (*kernel.parameters, *kernel.outputs):
        assert f"| `{field.name}` |" in page
    for method in kernel.methods:
        assert re.search(rf"^\| `{method.name}` \|", page, re.MULTILINE)
    assert "phi'' + a phi' + (R + c abs(phi')^n) sgn phi' + k phi = +-mu" in page


def test_what_is_indented_in_a_docstring_stands_as_it_is():
    import make_pages

    told = "\n".join(make_pages.prose("A law.\n\n    x_1 = 2*y            (1)\n\nwith x_1 and `y_2`."))
    assert told == "A law.\n\n\n```text\nx_1 = 2*y    (1)\n```\n\n\nwith x\\_1 and `y_2`."
