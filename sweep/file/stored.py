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
    from sweep.cells.schema import Coordinate
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
        return np.asarray(self.numbers[...])

    def __getitem__(self, key: Any) -> Any:
        return np.asarray(self.numbers[key])


class Stored:
    """What `sweep.results.statuses` looks at in a Dataset, of a file that was written just now. To be used with `with`.

    Parameters
    ----------
    output : Path
    study : Study
        That the file is of.
    """

    def __init__(self, output: Path, study: Study) -> None:
        schema = self._schema = output_schema(study, {})
        self._file = StoredFile(output)
        self._numbers = self._file.columns()
        self.coords: dict[str, Coordinate] = {c.name: c for c in schema.coordinates}
        self._columns = {c.name: c for c in schema.columns}

    def __enter__(self) -> Stored:
        return self

    def __exit__(self, *fault: object) -> None:
        self._file.close()

    def __contains__(self, name: str) -> bool:
        return name in self._columns or name in self.coords

    def __getitem__(self, name: str) -> StoredColumn:
        if name in self.coords:
            coordinate = self.coords[name]
            return StoredColumn(coordinate.dims, coordinate.attrs, np.asarray(coordinate.values))
        column = self._columns[name]
        return StoredColumn((*self._schema.grid.dims, *column.dims), column.attrs, self._numbers[name])
