"""A study file or keyword arguments in, a checked `Study` out; all mistakes are reported at once."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sweep.study.mistakes import did_you_mean, show
from sweep.study.model import Axis, Study
from sweep.study.study_parser import StudyParser
from sweep.system.errors import Mistake, StudyError, SweepError

__all__ = ["Axis", "Study", "as_study", "build_study", "read_study"]

LARGEST_TEXT = 50_000_000
"""Bytes of a study file."""


def read_study(path: str | Path, allow_import: bool = False) -> Study:
    """The study in a TOML file.

    Parameters
    ----------
    path : path
        Files named in the study are relative to its folder.
    allow_import : bool
        Allow a kernel named "module:NAME", whose module is imported.

    Raises
    ------
    SweepError
        The file cannot be read.
    StudyError
        It is no TOML, or has mistakes; all of them are listed.
    """
    path = Path(path)
    text = _read_text(path)
    keys = _parse(text, str(path))
    first = next((line.strip() for line in text.splitlines() if line.strip()), "")
    question = {"question": first.lstrip("# ").rstrip()} if first.startswith("#") else {}
    return StudyParser(str(path), path.parent, allow_import).study({**question, **keys}, text)


def build_study(*, allow_import: bool = False, **keys: Any) -> Study:
    """The study made of the same keys as a TOML file has.

    Parameters
    ----------
    allow_import : bool
        Allow a kernel named "module:NAME", whose module is imported.
    **keys
        title, question, kernel, method, rtol, outputs, design, axes, fixed, along, summary. Axes and coordinates may
        also be arrays or lists of numbers in SI units.

    Raises
    ------
    StudyError
        There are mistakes; all of them are listed.

    Examples
    --------
    >>> study = build_study(kernel="foliot", axes={"mu": [0.1, 1.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> study.axes["mu"].values
    array([0.1, 1. ])
    """
    return StudyParser("study", Path(), allow_import).study(keys, "")


def as_study(given: Study | Mapping[str, Any]) -> Study:
    """A study as it is, or made of the keys of `build_study`; a kernel of one's own is not imported for a mapping.

    Raises
    ------
    SweepError
        It is neither, or has mistakes.
    """
    if isinstance(given, Study):
        return given
    if not isinstance(given, Mapping):
        raise SweepError(f"expected a study, found {show(given)}; read a file with sweep.read_study")
    return StudyParser("study", Path(), False).study(given, "")


def _read_text(path: Path) -> str:
    if path.is_dir():
        raise SweepError(f"{path} is a folder; name a study file in it, e.g. {path / 'study.toml'}")
    if path.exists() and not path.is_file():
        raise SweepError(f"{path} is no regular file; a pipe could be waited for without end")
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_TEXT + 1)
    except FileNotFoundError:
        near = did_you_mean(path.name, [p.name for p in path.parent.glob("*.toml")])
        raise SweepError(f"{path}: no such file{near}") from None
    except (OSError, ValueError) as error:
        raise SweepError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > LARGEST_TEXT:
        raise SweepError(f"{path} is larger than {LARGEST_TEXT} bytes; keep long lists in a csv file")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SweepError(f"{path} is not a text file in UTF-8 (byte {error.start})") from None
    if not text.strip():
        raise SweepError(f"{path} is empty; `sweep kernels` lists what can be swept")
    return text


def _parse(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise StudyError(source, [_syntax_mistake(str(error), text)]) from None
    except ValueError:
        raise StudyError(
            source, [Mistake("file", "an integer has thousands of digits; no float64 is that large")]
        ) from None
    except RecursionError:
        raise StudyError(source, [Mistake("file", "lists or tables are nested too deeply")]) from None


def _syntax_mistake(error: str, text: str) -> Mistake:
    """What tomllib says ("... (at line 3, column 6)"), with the line as it is written."""
    what, _, place = error.rpartition(" (at ")
    if what.startswith(("Cannot overwrite", "Cannot declare")):
        what = "this key or table stands here a second time"
    numbers = re.fullmatch(r"line (\d+), column (\d+)\)", place)
    lines = text.splitlines()
    line = int(numbers[1]) if numbers else len(lines)
    return Mistake(f"line {line}" if numbers else "end of file", f"{what}: {lines[line - 1].strip()[:80]}")
