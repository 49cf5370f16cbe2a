"""Examples of the docstring of every public name of `sweep`, and of docs/laws.md, come out as they stand there."""

import doctest
from pathlib import Path

import pytest

import sweep
from sweep.show.accessor import SweepAccessor
from sweep.study.read import study

OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def documented(name):
    """The object of a public name; of a room that is called, the function; of `ds.sweep` its class."""
    return {"study": study, "accessor": SweepAccessor}.get(name) or getattr(sweep, name)


@pytest.mark.parametrize("name", [*sweep.__all__, "accessor"])
def test_the_example_of_a_public_name_is_right(name, tmp_path, monkeypatch):
    if name == "sensitivity":
        pytest.importorskip("SALib")
    monkeypatch.chdir(tmp_path)
    found = documented(name)
    tests = doctest.DocTestFinder(recurse=False).find(found, name, globs={})
    assert "Examples\n" in (found.__doc__ or ""), f"{name} has no section Examples"
    assert tests
    assert tests[0].examples
    told = []
    doctest.DocTestRunner(optionflags=OPTIONS).run(tests[0], out=told.append, clear_globs=True)
    failed = [text for text in told if text.startswith("*")]
    assert not failed, "".join(told)


def test_the_names_that_sweep_lists_are_the_public_ones_and_a_room_and_a_function_have_one_name():
    assert dir(sweep) == sorted(sweep.__all__)
    assert not [name for name in dir(sweep) if name.startswith("_")]
    assert sweep.study.read.study is study
    assert callable(sweep.study)


PAGE = Path(__file__).parent.parent.parent / "docs" / "laws.md"


def test_every_example_of_the_page_on_laws_is_true():
    text = "".join("\n" if row.startswith("```") else row for row in PAGE.read_text("utf-8").splitlines(keepends=True))
    examples = doctest.DocTestParser().get_doctest(text, {}, "laws.md", str(PAGE), 0)
    assert len(examples.examples) > 40
    told = []
    failed, _ = doctest.DocTestRunner().run(examples, out=told.append)
    assert not failed, "".join(told)


def test_every_question_has_a_good_and_a_misleading_example():
    sections = PAGE.read_text("utf-8").split("\n## ")[1:]
    sections = [section for section in sections if section.partition("\n")[0].endswith("?")]
    assert len(sections) == 8
    for section in sections:
        good, *misleading = section.split("*Misleading*")
        assert ">>>" in good
        assert misleading
        assert all(">>>" in part for part in misleading)
