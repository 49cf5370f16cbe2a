"""What a notebook shows of a study: its axes and its settings, as tables in HTML."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from sweep.cells.partition import row_blocks
from sweep.study.model import short
from sweep.words import Table

if TYPE_CHECKING:
    from sweep.study.model import Study


def study_html(study: Study) -> str:
    """A study's axes with their units, its method and cells; what a run takes, `sweep.plan` tells."""
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
    }
    return (
        f"<p><b>{escape(study.title)}</b><br>{escape(study.question)}</p>"
        + Table(axes, ("axis", "unit", "values", "from, to", "along")).html()
        + Table([row for row in settings.items() if row[1]], ("study", "")).html()
    )
