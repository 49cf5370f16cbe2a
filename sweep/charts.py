"""Pictures of results."""

from __future__ import annotations

import os
from typing import Any

import xarray as xr


def plot(
    dataset: xr.Dataset, path: str | os.PathLike[str] | None = None, *, y: str | None = None, x: str | None = None
) -> Any:
    """Figure of one output of a Dataset; saved to `path` (.png, .svg, .pdf) if given."""
    raise NotImplementedError
