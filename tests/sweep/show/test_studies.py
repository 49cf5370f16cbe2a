"""The studies that come with the package: listed, and copied to work on."""

import tomllib
from pathlib import Path

import pytest

import sweep
from sweep.cli import main
from sweep.show import studies

ROOT = Path(__file__).parents[3]


def test_every_study_is_listed_with_its_question(capsys):
    assert main(["studies"]) == 0
    said = capsys.readouterr().out
    for path in (ROOT / "studies").glob("*.py"):
        if not path.stem.startswith("_"):
            assert (f"  {path.stem} " in said) == (path.stem == "own_scene" or not path.stem.endswith("_scene"))
    assert "How does the period fall with the drive torque" in said or "drive torque" in said
    assert "three_models_denny" not in said
    assert all(studies.question(name).endswith("?") for name in studies.names())


@pytest.mark.parametrize("name", studies.names())
def test_a_copy_is_all_that_the_study_needs(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["studies", name]) == 0
    copied = {path.name for path in tmp_path.iterdir()}
    assert copied == set(capsys.readouterr().out.split())
    for path in tmp_path.glob("*.toml"):
        sweep.study(path, allow_import=True)
    for script in tmp_path.glob("*.py"):
        for other in (ROOT / "studies").glob("*.py"):
            ways = (f"import {other.stem}\n", f"from {other.stem} import", f'"{other.stem}:KERNEL"')
            if any(way in script.read_text() for way in ways):
                assert other.name in copied


def test_several_grids_of_one_study_are_copied_together(tmp_path):
    names = {path.name for path in studies.copy_study("three_models", tmp_path)}
    assert {"three_models_denny.toml", "three_models_viscous.toml", "_common.py"} <= names


def test_nobodys_file_is_overwritten(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("foliot_scaling.toml").write_text("mine")
    assert main(["studies", "foliot_scaling"]) == 2
    assert "is there already" in capsys.readouterr().err
    assert Path("foliot_scaling.toml").read_text() == "mine"
    assert not Path("foliot_scaling.py").exists()
    assert main(["studies", "foliot_scalling"]) == 2
    assert "did you mean foliot_scaling?" in capsys.readouterr().err


def test_a_shell_learns_the_commands(capsys):
    pytest.importorskip("shtab")
    for shell in ("bash", "zsh", "tcsh"):
        assert main(["completion", shell]) == 0
        assert "refine" in capsys.readouterr().out


def test_what_is_to_be_cited_is_this_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = (ROOT / "CITATION.cff").read_text().splitlines()
    assert f'version: "{project["version"]}"' in lines
    assert f"license: {project['license']}" in lines
    assert "cff-version: 1.2.0" in lines


@pytest.fixture
def shelf(tmp_path, monkeypatch):
    """A folder of studies: two grids of one question, a script alone, a scene of another, and a private module."""
    place = tmp_path / "studies"
    place.mkdir()
    for name, text in {
        "fall.toml": '# How fast?\nkernel = "fall_scene:KERNEL"\n',
        "fall.csv": "1\n",
        "fall_moon.toml": "#How fast there? \n",
        "fall_scene.py": "# A scene.\nfrom _shared import x\n",
        "fall_far.py": '"""How far?\n\nSo far."""\nimport _shared\nimport numpy\n',
        "fall_far.toml": "no comment\n",
        "fall_notes.txt": "# Is this one?",
        "_shared.py": "# Is this one?\n",
    }.items():
        (place / name).write_text(text)
    monkeypatch.setattr(studies, "FOLDERS", (tmp_path / "none", place))
    return place


def test_what_asks_a_question_is_a_study_and_its_further_grids_are_part_of_it(shelf):
    assert studies.names() == ["fall", "fall_far"]
    assert studies.question("fall_moon") == "How fast there?"
    assert studies.question("fall_scene") == "A scene."
    assert studies.question("nothing") == ""
    assert studies.studies_text() == "  study     question\n  fall      How fast?\n  fall_far  How far?"


def test_the_files_of_a_study_are_its_grids_tables_and_the_scripts_they_name(shelf, tmp_path):
    target = tmp_path / "mine"
    target.mkdir()
    (target / "_shared.py").write_text("old")
    copies = studies.copy_study("fall", target)
    assert [path.name for path in copies] == ["fall.toml", "fall_scene.py", "_shared.py", "fall.csv", "fall_moon.toml"]
    assert {path.parent for path in copies} == {target}
    assert (target / "_shared.py").read_text() == "# Is this one?\n"
    with pytest.raises(sweep.SweepError, match=r"fall\.toml is there already; copy the study into another folder"):
        studies.copy_study("fall", target)
    with pytest.raises(sweep.SweepError, match="No such file or directory"):
        studies.copy_study("fall", tmp_path / "no")
    with pytest.raises(sweep.SweepError, match='there is no study "xyzzy"; there are fall or fall_far'):
        studies.copy_study("xyzzy", target)


def test_without_any_folder_of_studies_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(studies, "FOLDERS", (tmp_path / "none",))
    with pytest.raises(sweep.SweepError, match="the studies are not installed"):
        studies.names()
