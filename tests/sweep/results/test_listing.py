"""The results of a folder."""

from running import interrupted, tall
from toy_studies import build

import sweep
from sweep.cli import main


def test_results_are_listed_with_what_became_of_them(tmp_path, capsys):
    sweep.run(build(axes={"height": [1.0, -1.0]}, question="How long does it fall?"), tmp_path / "a.h5").close()
    sweep.run(build(axes={"height": [1.0, 2.0, 3.0]}, summary={}), tmp_path / "b.h5").close()
    (tmp_path / "c.h5").write_text("no result")
    (tmp_path / "notes.txt").write_text("no result")
    found = sweep.list_results(tmp_path)
    assert [one.path.name for one in found] == ["a.h5", "b.h5", "c.h5"]
    a, b, c = found
    assert (a.question, a.cells, a.done, a.statuses) == ("How long does it fall?", 2, 1.0, {"OK": 1, "BAD_INPUT": 1})
    assert (b.cells, b.statuses) == (3, {"OK": 3})
    assert "not the result of a sweep" in c.fault
    assert a.when.startswith("20")
    assert main(["list", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "1 ok, 1 refused" in told
    assert "How long does it fall?" in told
    assert a.when[:10] not in told
    assert main(["list", str(tmp_path), "--all"]) == 0
    assert a.when[:10] in capsys.readouterr().out


def test_an_unfinished_one_is_listed_with_its_share(tmp_path):
    interrupted(tall(23), tmp_path / "a.h5")
    (found,) = sweep.list_results(tmp_path)
    assert 0 < found.done < 1
    assert found.cells == 23
    assert "PENDING" in found.statuses


def test_what_a_running_sweep_has_beside_its_output_is_listed_as_the_output(tmp_path):
    for name in ("a.h5.parts", "b.nc.unfinished", "c.h5.parts.old", "d.txt.parts", ".h5.log"):
        (tmp_path / name).write_text("")
    assert [one.path.name for one in sweep.list_results(tmp_path)] == ["a.h5", "b.nc"]
