"""What a notebook shows of a study and of a kernel: tables in HTML."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from kernels import catalogue
from kernels.interface import Field, Kernel, is_kept
from sweep.cells.block import sampled_study
from sweep.cells.grid import Grid
from sweep.cells.output_schema import part_columns
from sweep.cells.partition import row_blocks
from sweep.cells.turns import turns
from sweep.errors import SweepError
from sweep.explore.plan import small_duration
from sweep.runs.pool import cores
from sweep.show.kernels import catalogue_text, kernel_text
from sweep.study.kernel_lookup import load_kernel
from sweep.study.mistakes import limits
from sweep.study.model import short
from sweep.words import quantity

if TYPE_CHECKING:
    from sweep.study.model import Study

Rows = Sequence[Sequence[str]]


class KernelPage:
    """A kernel of the catalogue, or one's own: printed it tells all about itself, in a notebook as tables.

    Attributes
    ----------
    name : str
        As a study names it.
    kernel : Kernel
        Its declaration: parameters, outputs, methods.
    """

    def __init__(self, name: str, allow_import: bool = False) -> None:
        self.name, self.kernel, self._allow_import = name, load_kernel(name, allow_import), allow_import

    def __repr__(self) -> str:
        return kernel_text(self.name, self._allow_import)

    def _repr_html_(self) -> str:
        return kernel_html(self.name, self.kernel)


class Catalogue(Mapping[str, KernelPage]):
    """All kernels of the catalogue by name."""

    def __getitem__(self, name: str) -> KernelPage:
        if name not in catalogue.KERNELS:
            raise KeyError(name)
        return KernelPage(name)

    def __iter__(self) -> Iterator[str]:
        return iter(catalogue.KERNELS)

    def __len__(self) -> int:
        return len(catalogue.KERNELS)

    def __repr__(self) -> str:
        return catalogue_text()

    def _repr_html_(self) -> str:
        rows = [(name, page.kernel.doc.splitlines()[0], _methods(page.kernel)) for name, page in self.items()]
        return table(("kernel", "scene", "methods"), rows)


def kernels(name: str | None = None, allow_import: bool = False) -> Catalogue | KernelPage:
    """What can be swept: all kernels of the catalogue, or one of them with parameters, units, outputs and methods.

    Parameters
    ----------
    name : str, optional
        Of the catalogue, or "module:NAME".
    allow_import : bool
        Allow "module:NAME", whose module is imported.

    Raises
    ------
    SweepError
        There is no such kernel.

    Examples
    --------
    >>> import sweep
    >>> list(sweep.kernels())[:3]
    ['foliot', 'foliot_motion', 'foliot_ripple']
    >>> sweep.kernels("foliot").kernel.parameter("mu").unit
    'rad/s^2'
    """
    return Catalogue() if name is None else KernelPage(name, allow_import)


def kernel_html(name: str, kernel: Kernel) -> str:
    """A kernel's parameters, outputs and methods."""
    parameters = [(f.name, f.unit, limits(f), _default(f), f.doc) for f in kernel.parameters]
    outputs = [(f.name, f.unit, ", ".join(f.dims), f.doc) for f in kernel.outputs]
    methods = [(m.name, m.doc, ", ".join(m.excludes)) for m in kernel.methods]
    return (
        f"<p><b>{escape(name)}</b>: {escape(kernel.doc)}</p>"
        + table(("parameter", "unit", "allowed", "default", "meaning"), parameters)
        + table(("output", "unit", "along", "meaning"), outputs)
        + table(("method", "how", "cannot do"), methods)
    )


def study_html(study: Study) -> str:
    """A study's axes with their units, its method, cells and forecast."""
    axes = [
        (axis.name, _unit(study.kernel, axis.name), f"{len(axis):,}", f"{axis.label(0)} to {axis.label(-1)}", dim)
        for dim, names in study.dims.items()
        for axis in (study.axes[name] for name in names)
    ]
    title = f"<p><b>{escape(study.title)}</b><br>{escape(study.question)}</p>"
    settings = table(("study", ""), [row for row in _settings(study) if row[1]])
    return title + table(("axis", "unit", "values", "from, to", "along"), axes) + settings


def _settings(study: Study) -> Iterator[tuple[str, str]]:
    yield "kernel", study.kernel_name
    yield "method", "an axis" if "method" in study.axes else study.method
    yield "rtol", "an axis" if "rtol" in study.axes else f"{study.rtol:g}"
    yield "outputs", ", ".join(study.outputs)
    yield "design", study.design
    yield "where", study.where
    fixed = study.fixed.items()
    yield "fixed", ", ".join(f"{name} = {short(value)} [{_unit(study.kernel, name)}]" for name, value in fixed)
    shape = " x ".join(f"{n:,}" for n in study.grid_shape.values())
    yield "cells", f"{row_blocks(study).size:,}" + f" = {shape}" * (len(study.grid_shape) > 1)
    yield "forecast", forecast(study)


def forecast(study: Study) -> str:
    """About how long a run takes and how much it keeps, from a timed sample; where that has to compile: who tells."""
    rows = row_blocks(study)
    size = quantity(rows.count * sum(column.cell_bytes for column in part_columns(study)))
    if not _is_compiled(study):
        return f"{size}; sweep.plan tells the time"
    try:
        seconds = sampled_study(study).cost * rows.size / cores()
    except SweepError as error:
        return f"{size}; {error}"
    return f"about {small_duration(seconds)} on {cores()} cores, {size}"


def _is_compiled(study: Study) -> bool:
    """Whether a sample of cells will hardly have to compile: of `auto`, the method that is tried first is kept."""
    tried = [study.kernel.methods[turn.number] for turn in turns(study, Grid(study))]
    named = [method for method in study.kernel.methods if method.name == study.method]
    return all(is_kept(method.solve) for method in (named or tried)[:1])


def table(headings: Sequence[str], rows: Rows) -> str:
    """Rows of texts as a table of HTML; nothing where there are none."""
    if not rows:
        return ""
    head = "".join(f"<th style='text-align:left'>{escape(text)}</th>" for text in headings)
    lines = ["".join(f"<td style='text-align:left'>{escape(text)}</td>" for text in row) for row in rows]
    return f"<table><tr>{head}</tr>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def _unit(kernel: Kernel, axis: str) -> str:
    return next((field.unit for field in kernel.parameters if field.name == axis), "")


def _default(field: Field) -> str:
    if field.default is None:
        return "required"
    words = {str(float(number)): word for word, number in field.choices.items()}
    text = field.default if isinstance(field.default, str) else f"{field.default:g}"
    return words.get(str(field.default), text)


def _methods(kernel: Kernel) -> str:
    return ", ".join(method.name for method in kernel.methods)
