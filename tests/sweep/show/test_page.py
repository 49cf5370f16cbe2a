"""The page of a result: all of it in one file, nothing from elsewhere, nothing of the result's text run."""

from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import sweep
from sweep.cli import main
from sweep.show.page import page, write_page


class Tree(HTMLParser):
    """Gathers text, tags and attributes."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.text, self.attributes = [], "", []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data):
        self.text = " ".join(f"{self.text} {data}".split())


def foliot(**keys):
    axes = {"mu": {"spacing": "log", "start": 1e-3, "stop": 1e4, "num": 43}}
    return sweep.study(kernel="foliot", **{"axes": axes, "fixed": {"a": 1.0, "phi0": 1.0}} | keys)


@pytest.fixture(scope="module")
def text():
    """A page of a result whose texts are no friends of markup."""
    ds = sweep.run(foliot(question="How does <b>it</b> fall?"))
    evil = ds.assign_attrs(title='<script>alert("x")</script>', study="</pre><img src=x onerror=y>")
    return page(evil, Path("a<b>.h5"))


def test_the_page_tells_question_axes_exponents_statuses_and_provenance(text):
    told = (
        "How does <b>it</b> fall?",
        "drive torque per moment of inertia",
        "two laws with a smooth bend",
        "Fingerprint",
    )
    assert [words for words in told if words not in Tree(text).text] == []


def test_nothing_comes_from_elsewhere_and_no_text_of_the_result_becomes_markup(text):
    tree = Tree(text)
    assert not {"script", "link", "iframe", "b"} & set(tree.tags)
    sources = [value for name, value in tree.attributes if name in ("src", "href")]
    assert sources
    assert all(value.startswith("data:image/png;base64,") for value in sources)
    assert "url(" not in text


@pytest.mark.parametrize(
    ("keys", "drawn"),
    [
        ({"axes": {"mu": [1.0]}}, True),
        ({"axes": {"mu": [-1.0, -2.0]}}, False),  # refused, so there is no value to draw
        ({"axes": {"method": ["closed", "map"]}, "fixed": {"a": 1.0, "phi0": 1.0, "mu": 1.0}}, False),
        ({"axes": {"mu": [1.0, 2.0], "a": [0.5, 0.6]}, "fixed": {"phi0": 1.0}, "design": "zip"}, True),
        ({"axes": {"mu": np.geomspace(0.1, 10, 9), "a": np.geomspace(0.1, 10, 9)}, "fixed": {"phi0": 1.0}}, True),
        ({"summary": {"outputs": {"period": ["min", "max"]}}}, False),
    ],
)
def test_every_kind_of_result_has_a_page(keys, drawn, tmp_path):
    tree = Tree(page(sweep.run(foliot(**{"outputs": ["period"]} | keys)), tmp_path / "x.h5"))
    assert "cells" in tree.text
    assert ("img" in tree.tags) is drawn


def test_the_command_writes_it_in_the_units_asked_for(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sweep.run(foliot(), "foliot.h5")
    assert main(["report", "foliot.h5", "--unit", "amplitude=degree"]) == 0
    assert capsys.readouterr().out == "foliot.html\n"
    assert "[degree]" in (tmp_path / "foliot.html").read_text()
    for path, word in (("no/page.html", "cannot be written"), ("page.pdf", "name it")):
        with pytest.raises(sweep.SweepError, match=word):
            write_page(sweep.open_result("foliot.h5"), tmp_path / "foliot.h5", tmp_path / path)
    assert [p.name for p in tmp_path.iterdir() if "tmp" in p.name] == []
