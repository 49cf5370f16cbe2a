"""Tables that a notebook shows."""

import re
import subprocess
import sys

import pytest

import sweep

FOLIOT = {"kernel": "foliot", "outputs": ["period"], "fixed": {"phi0": {"value": 60, "unit": "degree"}, "a": 1.0}}


def cells(html):
    """Texts of the cells of all tables."""
    return re.findall(r"<td[^>]*>([^<]*)</td>", html)


def test_a_study_is_shown_with_units_method_cells_and_forecast():
    study = sweep.study(**FOLIOT, axes={"mu": [0.1, 1.0, 10.0], "R": [0.0, 0.01]}, where="R < mu", question="a < b?")
    sweep.run(study)
    found = cells(study._repr_html_())
    assert found[:5] == ["mu", "rad/s^2", "3", "0.1 to 10", "mu"]
    shown = dict(zip(found[10::2], found[11::2], strict=True))
    assert shown["method"] == "auto"
    assert shown["cells"] == "6 = 3 x 2"
    assert shown["where"] == "R &lt; mu"
    assert re.fullmatch(r"about .* on \d+ cores, .*B", shown["forecast"])
    assert "phi0 = 1.0472 [rad]" in shown["fixed"]
    assert "a &lt; b?" in study._repr_html_()


def test_a_study_is_shown_whatever_was_used_before():
    study = 'sweep.study(kernel="foliot", axes={"mu": [1.0]}, fixed={"phi0": 1.0})'
    code = f"import sweep; sweep.run; print({study}._repr_html_())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert "<table" in done.stdout


def test_the_text_of_a_study_is_no_path():
    with pytest.raises(sweep.SweepError, match=r"the text of a study, not its path; write .*tomllib\.loads"):
        sweep.study(sweep.to_toml(sweep.study(**FOLIOT, axes={"mu": [0.1, 1.0]})))


def test_kernels_and_a_kernel_are_shown():
    every = sweep.kernels()
    assert "foliot" in cells(every._repr_html_())
    assert "polisher_wear_point: " in repr(every)
    one = every["foliot"]
    assert {"mu", "rad/s^2", "period", "closed", "required"} <= set(cells(one._repr_html_()))
    assert repr(one).startswith("foliot: ")
    assert len(every) == len(list(every))
