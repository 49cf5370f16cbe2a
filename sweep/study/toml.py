"""A study written as the keys it can be built of again, and as the text of a study file."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from sweep.errors import SweepError
from sweep.study.model import Block, Study
from sweep.words import kind


def to_toml(study: Study) -> str:
    """The text of a study file that is this study, in SI units but for axes that are given by start and stop.

    Numbers are exact; values that came from a csv file are listed.

    Examples
    --------
    >>> import sweep
    >>> study = sweep.study(kernel="foliot", axes={"mu": [0.1, 1.0]}, fixed={"phi0": 1.0, "a": 1.0})
    >>> print(sweep.to_toml(study).splitlines()[-6])
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
        default = float(field.default) if isinstance(field.default, float | int) else field.default
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
