"""Accounts of cells: which status counts as what, in a run, in its reader and in the list of a folder."""

from pathlib import Path

import numpy as np
import pytest
from running import interrupted, tall
from toy_studies import build

import sweep
from kernels.interface import Status
from sweep.cli import main
from sweep.results.statuses import account
from sweep.study.read import to_toml


@pytest.mark.parametrize("number", [60, int(Status.NOT_ASKED), 200])
def test_a_status_that_is_none_is_failed_with_the_exit_status_of_that(number, tmp_path, monkeypatch, capsys):
    """And those that a kernel may give are kept, and of them none is called FAILED."""
    monkeypatch.chdir(tmp_path)
    given = [1.0 * status for status in Status if status < Status.NOT_ASKED]
    study = {"kernel": "bad:SAYING", "outputs": ["fall_time"], "allow_import": True}
    for heights, code in ((given[1:], 0), (sorted([*given[1:], number]), 4)):
        Path("s.toml").write_text(to_toml(sweep.study(**study, axes={"height": heights})))
        assert main(["run", "s.toml", "--allow-import", "--no-isolate", "--force"]) == code
        failed = ", 1 FAILED" if code else ""
        assert f"16 remarked, 9 refused, 3 unsolved{failed};" in capsys.readouterr().out
        with sweep.open_result("s.h5") as found:
            assert found.status.values.tolist() == [Status.FAILED if h == number else h for h in heights]
            assert np.isnan(found.fall_time).values.tolist() == [h >= 64 or h == number for h in heights]
        later = found.assign(status=found.status * 0 + 99)  # of a later version
        assert account(later).by_kind["FAILED"] == later.status.size
    assert main(["show", "s.h5"]) == 0
    assert "gave no number or status" in " ".join(capsys.readouterr().out.split())


def test_the_results_of_a_folder_are_listed_with_what_became_of_them(tmp_path):
    """And what a running sweep has beside its output, as that output."""
    sweep.run(build(axes={"height": [1.0, -1.0]}, question="How long does it fall?"), tmp_path / "a.h5").close()
    sweep.run(build(axes={"height": [1.0, 2.0, 3.0]}, summary={}), tmp_path / "b.h5").close()
    interrupted(tall(23), tmp_path / "c.h5")
    for name in ("d.h5", "e.h5.unfinished", "f.nc.unfinished", "g.h5.unfinished.old", "h.txt.unfinished", ".i.h5.log"):
        (tmp_path / name).write_text("no result")
    found = sweep.list_results(tmp_path)
    assert [one.path.name for one in found] == ["a.h5", "b.h5", "c.h5", "d.h5", "e.h5", "f.nc"]
    a, b, c, d, *_ = found
    assert (a.question, a.cells, a.done, a.statuses) == ("How long does it fall?", 2, 1.0, {"OK": 1, "BAD_INPUT": 1})
    assert (b.cells, b.statuses) == (3, {"OK": 3})
    assert c.cells == 23
    assert 0 < c.done < 1
    assert "not the result of a sweep" in d.fault
    assert (d.cells, d.done) == (0, 0.0)
