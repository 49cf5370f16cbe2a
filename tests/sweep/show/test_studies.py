"""The studies that come with the package: listed, and copied to work on."""

import tomllib
from pathlib import Path

import pytest

import sweep
from sweep.cli import main
from sweep.show import studies

ROOT = Path(__file__).parents[3]


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


def test_nobodys_file_is_overwritten(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("foliot_scaling.toml").write_text("mine")
    assert main(["studies", "foliot_scaling"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert Path("foliot_scaling.toml").read_text() == "mine"
    assert not Path("foliot_scaling.py").exists()
    assert main(["studies", "foliot_scalling"]) == 2
    assert "did you mean foliot_scaling?" in capsys.readouterr().err


def test_what_is_to_be_cited_is_this_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = (ROOT / "CITATION.cff").read_text().splitlines()
    assert f'version: "{project["version"]}"' in lines
    assert f"license: {project['license']}" in lines
    assert "cff-version: 1.2.0" in lines
