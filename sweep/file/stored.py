"""As much of a finished result as its account needs, without xarray, whose import takes longer than a small run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweep.cells.output_schema import output_schema
from sweep.file.reading import StoredFile

if TYPE_CHECKING:
    from sweep.study.model import Study


@dataclass(frozen=True)
class StoredColumn:
    """A variable of the file; its numbers are read when they are asked for."""

    dims: tuple[str, ...]
    attrs: Mapping[str, Any]
    numbers: Any

    @property
    def shape(self) -> tuple[int, ...]:
        """Length along every dimension."""
        return tuple(self.numbers.shape)

    @property
    def values(self) -> Any:
        """All its numbers."""
        return self[...]

    def __getitem__(self, key: Any) -> Any:
        return np.asarray(self.numbers[key])


class Stored(dict[str, StoredColumn]):
    """What `sweep.results.statuses` looks at in a Dataset, of a file that was written just now. To be used with `with`.

    Parameters
    ----------
    output : Path
    study : Study
        That the file is of.
    """

    def __init__(self, output: Path, study: Study) -> None:
        schema = output_schema(study, {})
        self._file = StoredFile(output)
        numbers = self._file.columns()
        self.coords = {c.name: StoredColumn(c.dims, c.attrs, np.asarray(c.values)) for c in schema.coordinates}
        found = {c.name: StoredColumn((*schema.grid.dims, *c.dims), c.attrs, numbers[c.name]) for c in schema.columns}
        super().__init__({**self.coords, **found})

    def __enter__(self) -> Stored:
        return self

    def __exit__(self, *fault: object) -> None:
        self._file.close()
