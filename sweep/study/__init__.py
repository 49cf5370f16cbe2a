"""A study: TOML (or a dict) in, a checked `Study` out, all mistakes at once.

Others may use
    `read`       study: of a file, of keys, or of a result; to_toml: a study as the text of its file
    `model`      Study, Axis, Summary; load_kernel: a kernel by the name that a study gives it
    `keys`       KEYS: what may stand at the top of a study
    `mistakes`   Mistakes, gathered and raised together; limits: what a field allows, in words
    `condition`  Condition, cells_where, names_in: read by Python's grammar, never run by it
    `designs`    a sampled design's axes for SALib

`values`, what stands under a key, is behind `read`.
The room itself may be called: `sweep.study(...)` is `sweep.study.read.study`.
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
