"""Reads a study from TOML, a dict or keywords, and checks it; `sweep.study(...)` is `sweep.study.read.study`.

Others may use
    `read`       study: reads a study from a file, from keys, or from a result; to_toml: writes one as TOML
    `model`      Study, Axis, Summary; load_kernel: finds a kernel by its name in a study
    `keys`       KEYS: the top-level keys of a study
    `mistakes`   Mistakes, collected and raised together; limits: the values that a field allows, in words
    `condition`  Condition, cells_where, names_in: conditions on cells, parsed but not executed by Python
    `designs`    the axes of a sampled design for SALib

`values`, the values of keys, is behind `read`. The module itself can be called.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _Room(ModuleType):
    """A package and a function by one name."""

    def __call__(self, *given: Any, **keys: Any) -> Any:
        from sweep.study.read import study

        return study(*given, **keys)


sys.modules[__name__].__class__ = _Room
