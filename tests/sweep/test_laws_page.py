"""What docs/laws.md says comes out as it stands there."""

import doctest
from pathlib import Path

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
