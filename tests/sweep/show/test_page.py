"""The page of a result: all of it in one file, nothing from elsewhere, nothing of the result's text run."""

import base64
import hashlib
import re
from html.parser import HTMLParser

import numpy as np
import pytest
import xarray as xr

import sweep
from sweep.cli import main
from sweep.show import page as inner
from sweep.show.page import page, write_page

VOID = {"meta", "img", "br"}


class Tree(HTMLParser):
    """Fails on tags that are not closed in order; gathers text, tags and attributes."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.words, self.attributes = [], [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def foliot(**keys):
    axes = {"mu": {"spacing": "log", "start": 1e-3, "stop": 1e4, "num": 43}}
    return sweep.study(kernel="foliot", **{"axes": axes, "fixed": {"a": 1.0, "phi0": 1.0}} | keys)


@pytest.fixture(scope="module")
def ds():
    return sweep.run(foliot(title="Period & drive", question="How does <b>it</b> fall?", fixed={"a": 1.0, "phi0": 1.0}))


def test_the_page_tells_question_axes_exponents_statuses_and_provenance(ds, tmp_path):
    tree = Tree(page(ds, tmp_path / "foliot.h5"))
    for words in (
        "Period & drive",
        "How does <b>it</b> fall?",
        "foliot.h5: complete, 43 cells.",
        "drive torque per moment of inertia",
        "period mu <<",
        "right to the wanted rtol",
        "numba",
        "Fingerprint",
    ):
        assert words in tree.text, words


def test_nothing_comes_from_elsewhere_and_no_text_of_the_result_becomes_markup(ds, tmp_path):
    evil = ds.assign_attrs(title='<script>alert("x")</script>', study="</pre><img src=x onerror=y>")
    tree = Tree(page(evil, tmp_path / "a<b>.h5"))
    assert not {"script", "link", "iframe", "b"} & set(tree.tags)
    sources = [value for name, value in tree.attributes if name in ("src", "href")]
    assert sources
    assert all(value.startswith("data:image/png;base64,") for value in sources)
    assert "url(" not in page(ds, tmp_path / "x.h5")


def test_each_output_has_its_picture(ds, tmp_path):
    found = re.findall(r'alt="(\w+)" src="data:image/png;base64,([^"]+)"', page(ds, tmp_path / "x.h5"))
    assert [name for name, _ in found] == ["period", "amplitude", "crossing_speed", "sensitivity", "multiplier"]
    assert all(base64.b64decode(data).startswith(b"\x89PNG") for _, data in found)


@pytest.mark.parametrize(
    "keys",
    [
        {"axes": {"mu": [1.0]}},
        {"axes": {"mu": [-1.0, -2.0]}},
        {"axes": {"method": ["closed", "map"]}, "fixed": {"a": 1.0, "phi0": 1.0, "mu": 1.0}},
        {"axes": {"mu": [1.0, 2.0], "a": [0.5, 0.6]}, "fixed": {"phi0": 1.0}, "design": "zip"},
        {"axes": {"mu": np.geomspace(0.1, 10, 9), "a": np.geomspace(0.1, 10, 9)}, "fixed": {"phi0": 1.0}},
        {"summary": {"outputs": {"period": ["min", "max"]}}},
    ],
)
def test_every_kind_of_result_has_a_page(keys, tmp_path):
    assert "cells" in Tree(page(sweep.run(foliot(**keys)), tmp_path / "x.h5")).text


def test_the_command_writes_it_in_the_units_asked_for(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sweep.run(foliot(), "foliot.h5")
    assert main(["report", "foliot.h5", "--unit", "amplitude=degree"]) == 0
    assert capsys.readouterr().out == "foliot.html\n"
    assert "[degree]" in (tmp_path / "foliot.html").read_text()
    with pytest.raises(sweep.SweepError, match="cannot be written"):
        write_page(sweep.open_result("foliot.h5"), tmp_path / "foliot.h5", tmp_path / "no" / "page.html")
    assert [p.name for p in tmp_path.iterdir() if "tmp" in p.name] == []


def test_outputs_without_a_value_have_no_picture(tmp_path):
    refused = sweep.run(foliot(axes={"mu": [0.01, 0.02, 0.03]}, fixed={"a": 1.0, "phi0": 1.0, "R": 1.0}))
    tree = Tree(page(refused, tmp_path / "foliot.h5"))
    assert "img" not in tree.tags
    assert "NEVER_STARTS" in tree.text


def pictured(monkeypatch):
    """Pictures are their names."""
    monkeypatch.setattr(inner, "_picture", lambda dataset, name: f"[{name}]" if name != "y3" else "")


def test_the_first_six_outputs_that_have_a_value_are_drawn(monkeypatch):
    pictured(monkeypatch)
    columns = {f"y{k}": ("x", [float(k), np.nan]) for k in range(9)}
    columns["y1"] = ("x", [np.nan, np.nan])
    (found,) = inner._figures(xr.Dataset(columns | {"status": ("x", [0, 0])}))
    assert found == '<h2>figures</h2>\n<div class="figures">[y0]\n[y2]\n[y4]\n[y5]\n[y6]</div>'
    assert list(inner._figures(xr.Dataset({"y3": ("x", [1.0]), "status": ("x", [0])}))) == []


def laws_of(n, x=(1.0, 10.0, 100.0, 1000.0), **attrs):
    """y = x^-2 on n lines."""
    y = np.outer(np.ones(n), np.array(x) ** -2.0)
    columns = {"y": (("a", "x"), y, attrs), "status": (("a", "x"), np.zeros(y.shape, np.int8))}
    return xr.Dataset(columns, {"a": np.arange(n) + 0.5, "x": list(x)})


def test_exponents_of_up_to_eight_lines_are_told():
    (found,) = inner._exponents(laws_of(8, units="s"))
    tree = Tree(found)
    assert tree.text.startswith(
        "exponents in x output over exponent interval largest misfit y (a = 0.5) x 1 to 1000 -2 "
    )
    assert tree.text.count("y (a = ") == 8
    assert "of 95 % confidence" in tree.text
    assert list(inner._exponents(laws_of(9, units="s"))) == []


@pytest.mark.parametrize("attrs", [{}, {"units": "1"}])
def test_pure_numbers_have_no_exponents(attrs):
    assert list(inner._exponents(laws_of(1, **attrs))) == []


def test_exponents_need_a_logarithmic_axis_and_positive_values():
    assert list(inner._exponents(laws_of(1, (1.0, 2.0, 3.0, 4.0), units="s"))) == []
    assert list(inner._exponents(-laws_of(1, units="s"))) == []
    some = laws_of(1, (1.0, 10.0, 100.0, 1000.0, 1e4), units="s")
    some.y[0, 2] = -7.0
    (found,) = inner._exponents(some)
    assert "x 1 to 1e+04 -2 " in Tree(found).text


def test_a_table_has_its_heading_and_rows():
    table = inner._table(("a", "<b>"), [("1", "&"), ("2", "x")])
    rows = "<tr><td>1</td><td>&amp;</td></tr><tr><td>2</td><td>x</td></tr>"
    head = "<thead><tr><th>a</th><th>&lt;b&gt;</th></tr></thead>"
    assert table == f'<div class="wide"><table>{head}<tbody>{rows}</tbody></table></div>'
    assert "thead" not in inner._table((), [("1",)])
    assert (
        Tree(inner._section("methods used", [("map", "1", "100 %")])).text
        == "methods used method cells share map 1 100 %"
    )


def test_the_fingerprint_is_sixteen_digits_of_a_hash():
    digits = hashlib.sha256(b"study and sources").hexdigest()[:16]
    assert inner._fingerprint({"fingerprint": "study and sources"}) == digits
    assert inner._fingerprint({}) == "e3b0c44298fc1c14"  # of nothing


def test_the_page_is_in_order_and_its_title_and_study_are_told(ds, tmp_path, monkeypatch):
    pictured(monkeypatch)
    text = page(ds.assign_attrs(study="kernel = <foliot>"), tmp_path / "foliot.h5")
    assert text.startswith('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n')
    heads = re.findall(r"<h[12]>(.*?)</h[12]>", text)
    assert heads == [
        "Period &amp; drive", "figures", "exponents in mu", "axes", "fixed", "outputs", "status", "methods used",
        "provenance", "study",
    ]  # fmt: skip
    assert (
        '<p class="question">How does &lt;b&gt;it&lt;/b&gt; fall?</p>\n<p class="account">foliot.h5: complete, 43'
        in text
    )
    assert text.count('class="question"') == 1
    assert "<pre>kernel = &lt;foliot&gt;</pre>" in text
    untitled = page(ds.assign_attrs(title="", study=""), tmp_path / "foliot.h5")
    assert "<h1>foliot</h1>" in untitled
    assert "<h2>study</h2>" not in untitled
