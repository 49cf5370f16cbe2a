"""What the study of `auto` against single methods concludes is so, on few cells."""

from pathlib import Path

import numpy as np
import pytest
import what_auto_saves as study
import xarray as xr

import sweep

STUDIES = Path(study.__file__).parent
TOLERANCES = (1e-3, 1e-12)
SMALL = 12


@pytest.fixture(scope="module")
def parts():
    """The kernel that compiles soonest."""
    files = [STUDIES / f"what_auto_saves{part}.toml" for part in ("_balance",)]
    return [study.work_precision(sweep.study(f), cells=SMALL, tolerances=TOLERANCES) for f in files]


def made(seconds, ok, silent=None):
    """A chart at one rtol of methods by name."""
    names = list(seconds)
    zeros = dict.fromkeys(names, 0.0)
    columns = {"seconds": seconds, "ok": ok, "silent": {**zeros, **(silent or {})}, "remarked": zeros}
    columns |= {"error_worst": zeros, "methods_used": dict.fromkeys(names, "")}
    data = {k: (("method", "rtol"), [[column[n]] for n in names]) for k, column in columns.items()}
    return xr.Dataset(data, {"method": names, "rtol": [1e-3]}, {"reference_error": 0.0, "cells": 9, "title": "t"})


def test_what_can_be_checked_holds(parts):
    for found in parts:
        lines = study.statements(found)
        assert [s.what for s in lines if s.holds is False] == []
        assert sum(s.holds is not None for s in lines) == 3
        assert len(lines) == 3 + len(TOLERANCES)


def test_the_best_single_method_is_the_fastest_of_those_that_give_the_most():
    seconds = {"auto": 2.0, "quick": 1.0, "whole": 8.0, "slow": 9.0}
    found = made(seconds, {"auto": 1.0, "quick": 0.9, "whole": 1.0, "slow": 1.0})
    assert study.best_single(found, 1e-3) == "whole"
    assert float(study.savings(found).saved[0]) == 4.0


def test_a_method_that_is_silently_wrong_gives_less():
    seconds = {"auto": 2.0, "quick": 1.0, "whole": 8.0}
    found = made(seconds, {"auto": 1.0, "quick": 1.0, "whole": 1.0}, {"quick": 0.1})
    assert study.best_single(found, 1e-3) == "whole"


def test_auto_that_gives_fewer_cells_or_lies_is_seen():
    seconds = {"auto": 2.0, "whole": 8.0}
    assert [s.holds for s in study.statements(made(seconds, {"auto": 0.9, "whole": 1.0}))[:3]] == [True, True, False]
    lying = made(seconds, {"auto": 1.0, "whole": 1.0}, {"auto": 0.1})
    assert [s.holds for s in study.statements(lying)[:3]] == [False, True, False]
    off = made(seconds, {"auto": 1.0, "whole": 1.0})
    off.error_worst[0] = 1.1e-3
    assert study.statements(off)[1].holds is False


def test_the_figure_shows_every_method_over_auto_and_rings_the_best(parts):
    page = study.figure(parts)
    axes = page.axes[0]
    found = parts[0]
    lines = {line.get_label(): line for line in axes.lines}
    for name in [m for m in found["method"].values if m != "auto"]:
        row = found.seconds.sel({"method": name}) / found.seconds.sel({"method": "auto"})
        np.testing.assert_allclose(lines[name].get_ydata(), row)
    assert len(axes.lines[-1].get_xdata()) == len(TOLERANCES)


def test_the_study_prints_its_table_and_draws_its_figure(parts, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study, "charted", lambda *_: parts)
    assert study.main([str(tmp_path / "what_auto_saves.toml")]) == 0
    text = capsys.readouterr().out
    assert " NO" not in text
    assert (tmp_path / "what_auto_saves.png").read_bytes().startswith(b"\x89PNG")


def test_every_part_is_a_study_file():
    assert {STUDIES / f"what_auto_saves{part}.toml" for part in study.PARTS} == set(
        STUDIES.glob("what_auto_saves*.toml")
    )
