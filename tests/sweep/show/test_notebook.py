"""Tables that a notebook shows."""

import re

import pytest

import sweep

FOLIOT = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": {"value": 60, "unit": "degree"}, "a": 1.0}}


def shown(thing):
    """What a notebook shows of it, and the texts of the cells of all tables in that."""
    html = thing._repr_html_()
    return html, re.findall(r"<td[^>]*>([^<]*)</td>", html)


def test_a_study_is_shown_with_units_method_and_cells():
    study = sweep.study(**FOLIOT, axes={"mu": [0.1, 1.0, 10.0], "R": [0.0, 0.01]}, where="R < mu", question="a < b?")
    html, found = shown(study)
    rows = dict(zip(found[10::2], found[11::2], strict=True))
    assert rows["method"] == "auto"
    assert rows["cells"] == "6 = 3 x 2"
    assert rows["where"] == "R &lt; mu"
    assert "phi0 = 1.0472 [rad]" in rows["fixed"]
    assert "a &lt; b?" in html


def test_the_text_of_a_study_is_no_path():
    with pytest.raises(sweep.SweepError, match=r"the text of a study, not its path; write .*tomllib\.loads"):
        sweep.study(sweep.to_toml(sweep.study(**FOLIOT, axes={"mu": [0.1, 1.0]})))
