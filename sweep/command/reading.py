"""What commands read and write: opened, checked, and reported where it cannot be."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from sweep.errors import SweepError

if TYPE_CHECKING:
    import xarray as xr

    from sweep.study.model import Study


def study_from(arguments: argparse.Namespace) -> Study:
    """The study that is named."""
    from sweep.study.read import study

    return study(arguments.study, allow_import=arguments.allow_import)


def solving(arguments: argparse.Namespace, study: Study) -> dict[str, Any]:
    """How cells are solved; those of a user's own kernel in processes of their own, unless it is said."""
    isolate = ":" in study.kernel_name if arguments.isolate is None else bool(arguments.isolate)
    workers = {"workers": arguments.workers} if "workers" in arguments else {}
    return {**workers, "isolate": isolate, "cell_timeout": arguments.cell_timeout}


def result_of(arguments: argparse.Namespace) -> contextlib.AbstractContextManager[xr.Dataset]:
    """The result that is named; one that is not complete where the command takes it."""
    return opened(arguments.result, getattr(arguments, "unfinished", True))


@contextlib.contextmanager
def opened(path: Path, unfinished: bool = True) -> Iterator[xr.Dataset]:
    """A result; where another program has changed it, what goes wrong with it is reported as that."""
    from sweep.file.open import changed, open_result

    if path.suffix == ".toml":
        raise SweepError(f"{path} is a study, not a result; compute it with: sweep run {path}")
    if not path.exists() and path.with_name(path.name + ".unfinished").exists():
        say(f"{path}: unfinished; cells that are not computed yet are NaN and PENDING", file=sys.stderr)
    with open_result(path) as found, changed(path):
        if "end" not in found.attrs and not unfinished:
            raise SweepError(f"{path}: unfinished; continue it with sweep run, or take what there is with --unfinished")
        yield found


def check_target_of(arguments: argparse.Namespace, target: Path, force: bool = False) -> None:
    """Raises SweepError where a command is not to write there; by `force` it looks at what is there itself."""
    from sweep.file.overwriting import check_target

    read = [getattr(arguments, name) for name in ("result", "study") if name in arguments]
    check_target(target, force=force or arguments.force, read=read)


def in_units_of(dataset: xr.Dataset, given: Sequence[str]) -> xr.Dataset:
    """A result in the units of `--unit`."""
    from sweep.results.units import in_units

    for text in given:
        if not all(text.partition("=")):
            raise SweepError(f'--unit: expected NAME=UNIT, found "{text}"; write e.g. --unit A0=degree')
    return in_units(dataset, {name: unit for name, _, unit in (text.partition("=") for text in given)})


def say(text: object, file: TextIO | None = None) -> None:
    """Prints, to stdout unless said otherwise, what may hold text of other people."""
    from sweep.words import printable

    print(printable(str(text)), file=file)
