"""Studies of the toy kernel, from text."""

import pytest
from toy_studies import HEAD

import sweep


@pytest.fixture
def read(tmp_path):
    """Reads a study from text; `head` goes before it."""

    def read(text, head=HEAD, allow_import=True):
        path = tmp_path / "fall.toml"
        path.write_text(head + text, encoding="utf-8")
        return sweep.study(path, allow_import=allow_import)

    return read


@pytest.fixture
def mistakes(read):
    """What a study is told: {where: message}."""

    def mistakes(text, **options):
        with pytest.raises(sweep.StudyError) as caught:
            read(text, **options)
        return {m.where: m.message for m in caught.value.mistakes}

    return mistakes


@pytest.fixture(autouse=True)
def _width(monkeypatch):
    """Texts are wrapped at 120 columns, whatever terminal the tests run in."""
    monkeypatch.setenv("COLUMNS", "120")
