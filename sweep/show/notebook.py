"""What a notebook shows of a study: its axes, its settings and a forecast, as tables in HTML."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from kernels.interface import is_kept
from sweep.cells.block import sampled_study
from sweep.cells.grid import Grid
from sweep.cells.partition import row_blocks
from sweep.cells.reduce import part_columns
from sweep.cells.solve import turns
from sweep.errors import SweepError
from sweep.explore.plan import small_duration
from sweep.runs.pool import cores
from sweep.study.model import short
from sweep.words import Table, quantity

if TYPE_CHECKING:
    from sweep.study.model import Study


def study_html(study: Study) -> str:
    """A study's axes with their units, its method, cells and forecast."""
    units = {field.name: field.unit for field in study.kernel.parameters}
    axes = [
        (axis.name, units.get(axis.name, ""), f"{len(axis):,}", f"{axis.label(0)} to {axis.label(-1)}", dim)
        for dim, names in study.dims.items()
        for axis in (study.axes[name] for name in names)
    ]
    shape = " x ".join(f"{n:,}" for n in study.grid_shape.values())
    settings = {
        "kernel": study.kernel_name,
        "method": "an axis" if "method" in study.axes else study.method,
        "rtol": "an axis" if "rtol" in study.axes else f"{study.rtol:g}",
        "outputs": ", ".join(study.outputs),
        "design": study.design,
        "where": study.where,
        "fixed": ", ".join(f"{name} = {short(value)} [{units.get(name, '')}]" for name, value in study.fixed.items()),
        "cells": f"{row_blocks(study).size:,}" + f" = {shape}" * (len(study.grid_shape) > 1),
        "forecast": forecast(study),
    }
    return (
        f"<p><b>{escape(study.title)}</b><br>{escape(study.question)}</p>"
        + Table(axes, ("axis", "unit", "values", "from, to", "along")).html()
        + Table([row for row in settings.items() if row[1]], ("study", "")).html()
    )


def forecast(study: Study) -> str:
    """About how long a run takes and how much it keeps, from a timed sample; where that has to compile: who tells."""
    rows = row_blocks(study)
    size = quantity(rows.count * sum(column.cell_bytes for column in part_columns(study)))
    # of `auto`, the method that is tried first is kept where a sample will hardly have to compile
    tried = [study.kernel.methods[turn.number] for turn in turns(study, Grid(study))]
    named = [method for method in study.kernel.methods if method.name == study.method]
    if not all(is_kept(method.solve) for method in (named or tried)[:1]):
        return f"{size}; sweep.plan tells the time"
    try:
        seconds = sampled_study(study).cost * rows.size / cores()
    except SweepError as error:
        return f"{size}; {error}"
    return f"about {small_duration(seconds)} on {cores()} cores, {size}"
