"""What a function was given, where it takes something else."""

from __future__ import annotations

import os
from typing import Any

from sweep.system.errors import SweepError


def require_dataset(name: str, given: Any, maker: str = "", attribute: str = "") -> None:
    """Refuses what is no Dataset.

    Parameters
    ----------
    name : str
        The function as users call it, e.g. "export".
    maker, attribute : str
        Where not every Dataset will do: the function that makes those that do, and an attribute that only they have.

    Raises
    ------
    SweepError
        With the way from what was given to a Dataset, where there is one.
    """
    import xarray as xr  # most of a short run's time

    if not isinstance(given, xr.Dataset):
        cure = f"sweep.{maker} gives one" if maker else _cure(given)
        raise SweepError(f"sweep.{name}: expected a Dataset, found {kind(given)}; {cure}")
    if attribute and attribute not in given.attrs:
        raise SweepError(f"sweep.{name}: expected a Dataset of sweep.{maker}, found another")


def kind(value: Any) -> str:
    """'a list', 'an int', 'nothing'."""
    word = type(value).__name__
    return "nothing" if value is None else f"{'an' if word[0].lower() in 'aeiou' else 'a'} {word}"


def _cure(given: Any) -> str:
    if isinstance(given, str | os.PathLike):
        return f'open the file first: sweep.open_result("{os.fspath(given)}")'
    if hasattr(given, "kernel_name"):
        return "run the study first: sweep.run(study)"
    return "sweep.run and sweep.open_result give one"
