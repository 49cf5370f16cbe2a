"""Commands that try a study out: plan, refine, chart."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sweep.command.files import check_target_of, is_isolated, result_of, say, study_from, study_of_result
from sweep.command.options import (
    ALL,
    ALLOW_IMPORT,
    CELL_TIMEOUT,
    FORCE,
    ISOLATE,
    RESULT,
    STUDY,
    WORKERS,
    Command,
    option,
    output,
)
from sweep.errors import SweepError


def _plan(arguments: argparse.Namespace) -> None:
    from sweep.explore.plan import plan
    from sweep.runs.progress import Progress

    study = study_from(arguments)
    found = plan(
        study,
        workers=arguments.workers,
        note=Progress(1, sys.stderr, "plan").note,
        isolate=is_isolated(arguments, study),
        cell_timeout=arguments.cell_timeout,
    )
    say(found)
    if found.warnings:
        raise SweepError("\n".join(f"{arguments.study}: {text}" for text in found.warnings))


def _refine(arguments: argparse.Namespace) -> None:
    from sweep.explore.refine import refine
    from sweep.study.read import study as as_study

    check_target_of(arguments, arguments.output, force=True)
    with result_of(arguments) as dataset:
        study = as_study(dataset, allow_import=arguments.allow_import)
        found = refine(
            dataset,
            arguments.y,
            arguments.tolerance,
            path=arguments.output,
            study=study,
            most_cells=arguments.most_cells,
            workers=arguments.workers,
            force=arguments.force,
            isolate=is_isolated(arguments, study),
            cell_timeout=arguments.cell_timeout,
        )
    say(f"{arguments.output}: {found}")


def _chart(arguments: argparse.Namespace) -> None:
    from sweep.explore.work_precision import TOLERANCES, precision_text, work_precision
    from sweep.runs.progress import Progress
    from sweep.show.charts import save
    from sweep.show.plot import plot

    study = study_of_result(arguments) if arguments.study.suffix == ".h5" else study_from(arguments)
    output = arguments.output or Path(f"{arguments.study.stem}_chart.png")
    check_target_of(arguments, output)
    found = work_precision(
        study,
        methods=arguments.methods,
        tolerances=arguments.rtol or TOLERANCES,
        cells=arguments.cells,
        reference=arguments.reference,
        note=Progress(1, sys.stderr, "chart").note,
        isolate=is_isolated(arguments, study),
        cell_timeout=arguments.cell_timeout,
    )
    say(precision_text(found, arguments.all))
    save(plot(found), output)
    say(output)


COMMANDS = {
    "plan": Command(
        "cells, bytes, memory and a timed forecast, before anything runs",
        _plan,
        *(STUDY, WORKERS, ALLOW_IMPORT, ISOLATE, CELL_TIMEOUT),
    ),
    "refine": Command(
        "add cells to a result where it bends, until it can be interpolated",
        _refine,
        RESULT,
        option("--y", metavar="OUTPUT", nargs="+", required=True),
        option("--tolerance", "relative, e.g. 1e-3", metavar="SHARE", type=float, required=True),
        output("REFINED.h5", required=True),
        FORCE,
        option("--most-cells", "altogether; default: 1000000", metavar="N", type=int, default=1_000_000),
        *(WORKERS, ALLOW_IMPORT, ISOLATE, CELL_TIMEOUT),
    ),
    "chart": Command(
        "error against time of every method of a kernel, on the cells of a study or a result",
        _chart,
        STUDY,
        output("FILE.png", "default: the study's name with _chart.png, here"),
        FORCE,
        option("--methods", "default: auto and all that can do the study", metavar="METHOD", nargs="+"),
        option("--rtol", "default: 1e-3 to 1e-13", metavar="RTOL", nargs="+", type=float),
        option("--cells", "of the study at most; default: 1024", metavar="N", type=int, default=1024),
        option("--reference", "taken for the truth; default: the one with the best bound", metavar="METHOD"),
        *(ALL, ALLOW_IMPORT, ISOLATE, CELL_TIMEOUT),
    ),
}
