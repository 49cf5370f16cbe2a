"""What a function was given, where it takes something else."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from sweep.system.errors import SweepError

RESULT = "run or open_result"


def check_dataset(given: Any, whose: str = RESULT, needs: Sequence[str] = ()) -> None:
    """Raises SweepError where it is no Dataset with these variables; `whose`: from what it comes."""
    import xarray as xr  # most of a short run's time

    if not isinstance(given, xr.Dataset):
        cure = _cure(given) if whose == RESULT else ""
        raise SweepError(f"expected a Dataset from {whose}; found a {type(given).__name__}{cure}")
    missing = [name for name in needs if name not in given]
    if missing:
        raise SweepError(f"expected a Dataset from {whose}; this one has no {', '.join(map(str, missing))}")


def _cure(given: Any) -> str:
    if isinstance(given, str | os.PathLike):
        return f'; open the file first: sweep.open_result("{os.fspath(given)}")'
    return "; run the study first: sweep.run(study)" if hasattr(given, "kernel_name") else ""
