"""Reads a study from a file, a mapping or keywords, reporting all mistakes at once; writes one as TOML."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sweep.errors import Mistake, StudyError, SweepError, reason
from sweep.study.keys import read_keys
from sweep.study.mistakes import show
from sweep.study.model import Block, Study
from sweep.words import as_path, did_you_mean, kind, listed

KEYWORDS = 'keywords, e.g. kernel="foliot", axes={"mu": [0.1, 1.0]}, fixed={"phi0": 1.0, "a": 1.0}'

Given = Study | str | os.PathLike[str] | Mapping[str, Any]
"""Accepted forms of a study: a Study, its file, its keys, or a result that came from it (a Dataset is a Mapping)."""


def study(given: Given | None = None, /, *, allow_import: bool = False, **keys: Any) -> Study:
    """Read and check a study from a TOML file, a dict of its keys, keywords, or a result.

    Parameters
    ----------
    given : path, mapping, Dataset or Study, optional
        A study file (files named in it are relative to its folder), a dict of the same keys, or a Dataset of `run` or
        `open_result`, which contains its study; a Study is returned unchanged. None: the keys are keywords.
    allow_import : bool
        Allow a kernel named "module:NAME", whose module is imported.
    **keys
        title, question, kernel, method, rtol, outputs, design, axes, fixed, along, summary. Axes and coordinates may
        also be arrays or lists of numbers in SI units, or have a unit themselves: a DataArray of a result, or pint's.

    Raises
    ------
    SweepError
        `given` is none of these, or the file cannot be read.
    StudyError
        The file is not TOML, or has mistakes; all of them are listed.

    Examples
    --------
    >>> from pathlib import Path
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", axes={"mu": [0.1, 1.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> study
    <Study 'foliot over mu': foliot over mu (2)>
    >>> study.axes["mu"].values
    array([0.1, 1. ])
    >>> lines = ["# How fast?", 'kernel = "foliot"', "axes.mu = [0.1, 1.0]", "fixed = { phi0 = 1.0, a = 1.0 }"]
    >>> _ = Path("how_fast.toml").write_text("\\n".join(lines))
    >>> sweep.study("how_fast.toml").question
    'How fast?'
    >>> sweep.study(sweep.run(study))
    <Study 'foliot over mu': foliot over mu (2)>
    """
    if given is None and not keys:
        raise SweepError(f"there is no study: give one, the path of its TOML file, a dict of its keys, or {KEYWORDS}")
    if given is not None and keys:
        raise SweepError(f"{listed(keys, word='and')}: keywords do not go with a study; give one of the two")
    if isinstance(given, Study):
        return given
    if hasattr(given, "data_vars"):
        return Study.of(given, allow_import=allow_import)  # type: ignore[arg-type]
    if given is None or isinstance(given, Mapping):
        return read_keys(keys if given is None else given, "", "study", Path(), allow_import)
    if not isinstance(given, str | os.PathLike):
        raise SweepError(f"expected a study, its path, or a dict of its keys, found {show(given)}; or write {KEYWORDS}")
    if "\n" in os.fspath(given):
        raise SweepError("this is the text of a study, not its path; write sweep.study(tomllib.loads(text))")
    path = as_path(given)
    keys, text = _of_file(path)
    return read_keys(keys, text, str(path), path.parent, allow_import)


def _of_file(path: Path) -> tuple[dict[str, Any], str]:
    """The keys of a study file, its first line as the question, and its text.

    Raises SweepError where it is none; StudyError with what tomllib says, and the line as it is written.
    """
    others = {
        ".h5": "a result, not a study; look at it with: sweep show",
        ".py": "a study in Python; run it with: python",
    }
    if other := others.get(path.suffix.replace(".nc", ".h5")):
        raise SweepError(f"{path} is {other} {path}")
    try:
        if path.exists() and not path.is_file():
            raise SweepError(f"{path} is a folder or a pipe, not a file; name a study file, e.g. study.toml")
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        near = did_you_mean(path.stem, [p.stem for p in path.parent.glob("*.toml")]).replace("?", ".toml?")
        raise SweepError(f"{path}: no such file{near}") from None
    except UnicodeDecodeError as error:
        raise SweepError(f"{path} is not a text file in UTF-8 (byte {error.start})") from None
    except (OSError, ValueError) as error:
        raise SweepError(f"{path} cannot be read: {reason(error)}") from None
    if not text.strip():
        raise SweepError(f"{path} is empty; `sweep kernels` lists what can be swept")
    first = next(line.strip() for line in text.splitlines() if line.strip())
    question = {"question": first.lstrip("# ").rstrip()} if first.startswith("#") else {}
    try:
        return {**question, **tomllib.loads(text)}, text
    except tomllib.TOMLDecodeError as error:
        what, _, place = str(error).rpartition(" (at ")  # "... (at line 3, column 6)"
        if what.startswith(("Cannot overwrite", "Cannot declare")):
            what = "this key or table stands here a second time"
        number, lines = re.match(r"line (\d+)", place), text.splitlines()
        line = lines[int(number[1]) - 1 if number else -1].strip()[:80]
        mistake = Mistake(number[0] if number else "end of file", f"{what}: {line}")
    except ValueError:
        mistake = Mistake("file", "an integer has thousands of digits; no float64 is that large")
    except RecursionError:
        mistake = Mistake("file", "lists or tables are nested too deeply")
    raise StudyError(str(path), [mistake])


def to_toml(study: Study) -> str:
    """The text of a file for this study, in SI units except for axes with start and stop.

    Numbers are exact; values that came from a csv file are listed.

    Examples
    --------
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", axes={"mu": [0.1, 1.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> print(sweep.to_toml(study).splitlines()[-5])
    mu = [0.1, 1.0]
    """
    if not isinstance(study, Study):
        raise SweepError(f"sweep.to_toml: expected a Study, found {kind(study)}; sweep.study gives one")
    # the keys that `sweep.study` makes the study of
    found: dict[str, Any] = {"title": study.title, "question": study.question, "kernel": study.kernel_name}
    found |= {name: getattr(study, name) for name in ("method", "rtol") if name not in study.axes}
    found["outputs"] = list(study.outputs)
    found |= {"where": study.where} if study.where else {}
    entries: dict[str, Any] = {}
    for name, axis in study.axes.items():
        entries[name] = dict(axis.entry) if axis.entry else list(axis.words or ()) or axis.values.tolist()
    blocks = [
        {
            "design": {"kind": block.design, **block.options} if block.options else block.design,
            "axes": {name: entries[name] for name in block.axes},
        }
        for block in study.blocks or (Block(study.design, tuple(study.axes)),)
    ]
    found |= {"blocks": blocks} if study.design == "blocks" else {**blocks[0], "axes": entries}
    found["fixed"] = {}
    for name, value in study.fixed.items():
        field = study.kernel.parameter(name)
        default = study.fixed.get(field.default) if isinstance(field.default, str) else field.default
        default = float(default) if isinstance(default, int) else default
        if repr(value) != repr(default):  # -0.0 is not 0.0
            words = {float(number): word for word, number in field.choices.items()}
            found["fixed"][name] = words[float(value)] if words else np.asarray(value).tolist()
    found["along"] = {name: values.tolist() for name, values in study.along.items() if len(values)}
    if study.summary is not None:
        edges = {name: values.tolist() for name, values in study.summary.edges.items()}
        outputs = {name: list(reductions) for name, reductions in study.summary.outputs.items()}
        found["summary"] = {"over": list(study.summary.over), "outputs": outputs, "edges": edges}
    # their text: what is no table first
    tables = ("axes", "fixed", "along", "summary")
    lines = [f"{key} = {_value(value)}" for key, value in found.items() if key not in (*tables, "blocks")]
    for block in found.get("blocks", ()):
        lines += ["", "[[blocks]]", *(f"{key} = {_value(value)}" for key, value in block.items())]
    for table in tables:
        if found.get(table):
            lines += ["", f"[{table}]", *(f"{_key(name)} = {_value(entry)}" for name, entry in found[table].items())]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    """A value of TOML, on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, str):
        # TOML escapes as JSON does, and one letter more
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _key(key: str) -> str:
    """A key, in quotes where it needs them."""
    return key if re.fullmatch("[A-Za-z0-9_-]+", key) else _value(key)
