"""The studies that come with foliot: what they ask, and one of them as files to work on."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from sweep.errors import SweepError
from sweep.words import columns, did_you_mean, listed

HERE = Path(__file__).parents[1]
FOLDERS = (HERE / "_studies", HERE.parent / "studies")
"""Of an installed package, and of a checkout."""
NAMED = re.compile(r"^\s*(?:from|import)\s+(\w+)|\"(\w+):\w+\"", re.MULTILINE)
"""Modules that a script imports, or a kernel is in."""


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
    return sorted(name for name in own if not any(name.startswith(f"{other}_") and _is_part(name) for other in own))


def _is_part(name: str) -> bool:
    return not (folder() / f"{name}.py").exists()


def studies_text() -> str:
    """Every study and its question."""
    return columns([("study", "question"), *((name, question(name)) for name in names())])


def question(name: str) -> str:
    """First line of a study's TOML, or of what its script says of itself."""
    for suffix, pattern in ((".toml", r"# ?(.*)"), (".py", r'(?:# |""")(.*)')):
        path = folder() / f"{name}{suffix}"
        match = re.match(pattern, path.read_text(encoding="utf-8")) if path.exists() else None
        if match:
            return match[1].strip()
    return ""


def copy_study(name: str, target: Path = Path()) -> list[Path]:
    """Copy a study, its grids and its script with what that imports, and give the copies.

    Raises
    ------
    SweepError
        There is no such study, or a file of it is there already.
    """
    if name not in names():
        known = names()
        raise SweepError(f'there is no study "{name}"{did_you_mean(name, known) or f"; there are {listed(known)}"}')
    sources = _files(name)
    for source in sources:
        if (target / source.name).exists() and not source.name.startswith("_"):
            raise SweepError(f"{target / source.name} is there already; copy the study into another folder")
    try:
        return [Path(shutil.copyfile(source, target / source.name)) for source in sources]
    except OSError as error:
        raise SweepError(f"{error.filename2 or error.filename}: {error.strerror}") from None


def _files(name: str) -> list[Path]:
    place, own = folder(), names()
    found = [place / f"{name}.toml", place / f"{name}.csv"]
    found += sorted(p for p in place.glob(f"{name}_*.*") if p.suffix in (".toml", ".csv") and p.stem not in own)
    return _with_scripts([*found, place / f"{name}.py"])


def _with_scripts(files: list[Path]) -> list[Path]:
    """Those of the files that there are, and the scripts beside them that they name, and so on."""
    found: dict[Path, None] = {}
    waiting = list(reversed(files))
    while waiting:
        path = waiting.pop()
        if path.exists() and path not in found:
            found[path] = None
            words = NAMED.findall(path.read_text(encoding="utf-8"))
            waiting += [path.with_name(f"{imported or kernel}.py") for imported, kernel in words]
    return list(found)
