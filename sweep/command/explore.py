"""Commands that try a study out: plan, refine, chart."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sweep.command import options as o
from sweep.command.options import command, option
from sweep.command.reading import check_target_of, opened, result_of, say, solving, study_from
from sweep.errors import SweepError


@command("sweep plan foliot_scaling.toml", o.STUDY, *o.SOLVING)
def plan(arguments: argparse.Namespace) -> None:
    """Cells, bytes, memory and a timed forecast, before anything runs."""
    from sweep.explore.plan import plan
    from sweep.runs.progress import Progress

    study = study_from(arguments)
    found = plan(study, note=Progress(1, sys.stderr, "plan").note, **solving(arguments, study))
    say(found)
    if found.warnings:
        raise SweepError("\n".join(f"{arguments.study}: {text}" for text in found.warnings))


@command(
    "sweep refine foliot.h5 --y period --tolerance 1e-3 -o fine.h5",
    o.RESULT,
    option("--y", metavar="OUTPUT", nargs="+", required=True),
    option("--tolerance", "relative, e.g. 1e-3", metavar="SHARE", type=float, required=True),
    o.output("REFINED.h5", required=True),
    o.FORCE,
    option("--most-cells", "altogether; default: 1000000", metavar="N", type=int, default=1_000_000),
    *o.SOLVING,
)
def refine(arguments: argparse.Namespace) -> None:
    """Add cells to a result where it bends, until it can be interpolated."""
    from sweep.explore.refine import refine
    from sweep.study.read import study as as_study

    check_target_of(arguments, arguments.output, force=True)
    with result_of(arguments) as dataset:
        study = as_study(dataset, allow_import=arguments.allow_import)
        keys = {"most_cells": arguments.most_cells, "force": arguments.force, **solving(arguments, study)}
        found = refine(dataset, arguments.y, arguments.tolerance, path=arguments.output, study=study, **keys)
    say(f"{arguments.output}: {found}")


@command(
    "sweep chart foliot_scaling.toml --rtol 1e-6 1e-9",
    o.STUDY,
    o.output("FILE.png", "default: the study's name with _chart.png, here"),
    o.FORCE,
    option("--methods", "default: auto and all that can do the study", metavar="METHOD", nargs="+"),
    option("--rtol", "default: 1e-3 to 1e-13", metavar="RTOL", nargs="+", type=float),
    option("--cells", "of the study at most; default: 1024", metavar="N", type=int, default=1024),
    option("--reference", "method taken as true; default: the one with the smallest bound", metavar="METHOD"),
    o.ALL,
    *o.SOLVING[1:],
)
def chart(arguments: argparse.Namespace) -> None:
    """Error against time of every method of a kernel, on the cells of a study or a result."""
    from sweep.explore.work_precision import TOLERANCES, precision_text, work_precision
    from sweep.runs.progress import Progress
    from sweep.show.plot import plot
    from sweep.study.read import study as as_study

    target = arguments.output or Path(f"{arguments.study.stem}_chart.png")
    check_target_of(arguments, target)
    if arguments.study.suffix == ".h5":
        with opened(arguments.study) as dataset:
            study = as_study(dataset, allow_import=arguments.allow_import)
    else:
        study = study_from(arguments)
    keys = {name: getattr(arguments, name) for name in ("methods", "cells", "reference")}
    keys |= {"tolerances": arguments.rtol or TOLERANCES, "note": Progress(1, sys.stderr, "chart").note}
    found = work_precision(study, **keys, **solving(arguments, study))
    say(precision_text(found, arguments.all))
    plot(found, target)
    say(target)
