"""The studies that come with foliot: a list of their questions, and copies to work on."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from sweep.errors import SweepError
from sweep.file import disk
from sweep.words import Table, did_you_mean, listed

HERE = Path(__file__).parents[1]
FOLDERS = (HERE / "_studies", HERE.parent / "studies")
"""Folders of studies in an installed package, and in a checkout."""
NAMED = re.compile(r"^\s*(?:from|import)\s+(\w+)|\"(\w+):\w+\"", re.MULTILINE)
"""Modules that a script imports, or that contain a kernel."""


def folder() -> Path:
    """Where the studies are. Raises SweepError."""
    found = next((path for path in FOLDERS if path.is_dir()), None)
    if found is None:
        raise SweepError("the studies are not installed; they are in the folder `studies` of a checkout")
    return found


def names() -> list[str]:
    """Of all studies: a TOML file, or a script whose first line asks something, or both; others are scenes of these."""
    every = {path.stem for path in folder().glob("*") if path.suffix in (".toml", ".py")}
    own = {name for name in every if not name.startswith("_") and question(name).endswith("?")}
    # of several grids for one question the first one's name is the study's
    parts = {name for name in own if not (folder() / f"{name}.py").exists()}
    return sorted(name for name in own if name not in parts or not any(name.startswith(f"{other}_") for other in own))


def studies_text() -> str:
    """Every study and its question."""
    return Table([(name, question(name)) for name in names()], ("study", "question")).text()


def question(name: str) -> str:
    """First line of a study's TOML, or of what its script says of itself."""
    for suffix, pattern in ((".toml", r"# ?(.*)"), (".py", r'"""(.*)')):
        path = folder() / f"{name}{suffix}"
        match = re.match(pattern, path.read_text(encoding="utf-8")) if path.exists() else None
        if match:
            return match[1].strip()
    return ""


def copy_study(name: str, target: Path = Path(), force: bool = False) -> list[Path]:
    """Copy a study, its grids, and its script with those that it names, and give the copies.

    Raises
    ------
    SweepError
        There is no such study, or another file is where one of it is to be, unless by `force`.
    """
    place, own = folder(), names()
    if name not in own:
        raise SweepError(f'there is no study "{name}"{did_you_mean(name, own) or f"; there are {listed(own)}"}')
    grids = sorted(p for p in place.glob(f"{name}_*.*") if p.suffix in (".toml", ".csv") and p.stem not in own)
    waiting = [place / f"{name}.py", *reversed(grids), place / f"{name}.csv", place / f"{name}.toml"]
    sources: list[Path] = []
    while waiting:
        path = waiting.pop()
        if path.exists() and path not in sources:
            sources.append(path)
            words = NAMED.findall(path.read_text(encoding="utf-8"))
            waiting += [path.with_name(f"{imported or kernel}.py") for imported, kernel in words]
    for source in sources:
        copy = target / source.name
        same = copy.is_file() and copy.read_bytes() == source.read_bytes()
        disk.check_target(copy, force=force or same, read=[source])
    for source in sources:
        with disk.replacing(target / source.name) as part:
            shutil.copyfile(source, part)
    return [target / source.name for source in sources]
