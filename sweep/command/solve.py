"""Commands that solve cells: plan, run, refine, chart, check, cell."""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
from pathlib import Path

import sweep
from sweep.command import options as o
from sweep.command.options import command, option, switch
from sweep.command.reading import DIFFERENT, Outcome, explained, opened, say, solving, study_from, tell
from sweep.errors import CELLS_FAILED, COMPLETE, EXIT_CODES, INCOMPLETE, SweepError, signals_held

NOTIFY_SECONDS = 60
"""What the command of --notify may take."""
RUN_OPTIONS = ("cluster", "force", "extend", "until", "retry_failed", "repair")
"""Options of `run` that are arguments of the function of that name."""


@command("sweep plan foliot_scaling.toml", o.STUDY, *o.SOLVING, o.JSON)
def plan(arguments: argparse.Namespace) -> None:
    """Estimate cells, file size, memory and time of a run, before it begins."""
    from sweep.runs.progress import Progress

    study = study_from(arguments)
    found = sweep.plan(study, note=Progress(1, sys.stderr, "plan").note, **solving(arguments, study))
    tell(arguments, found)
    if found.warnings:
        raise SweepError("\n".join(f"{arguments.study}: {text}" for text in found.warnings))


@command(
    "sweep run foliot_scaling.toml --until 07:00",
    o.STUDY,
    o.output("OUT.h5", "default: the study's name with .h5, here", ".h5", checked=False),
    switch("--force", "overwrite the result of another study"),
    switch("--extend", "add the new cells to a result of the same study with fewer values on its axes"),
    switch("--repair", "compute only the damaged cells of a result that is damaged on disk"),
    option(
        "--cluster",
        "compute on the workers of a dask scheduler, e.g. tcp://10.0.0.1:8786, instead of here",
        metavar="ADDRESS",
    ),
    option("--until", "stop at this time, with exit status 3; the same command continues", metavar="07:00"),
    *o.SOLVING,
    switch("--retry-failed", "compute the FAILED cells of a complete result again"),
    option(
        "--notify", "run this command at the end; $SWEEP_EXIT and $SWEEP_SUMMARY say how it ended", metavar="COMMAND"
    ),
    switch("--log-json", "write the log, OUT.h5.log, as JSON, one object per line"),
)
def run(arguments: argparse.Namespace) -> Outcome:
    """Compute a study, or continue where it stopped."""
    with signals_held():  # struck by one, a library's import fails in words of its own
        study, target = study_from(arguments), arguments.output
        from sweep.runs.progress import log, log_path, logging_to
        from sweep.runs.run import complete

    path = log_path(target) if target.parent.is_dir() else None
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(logging_to(path, arguments.log_json))
        except OSError as fault:
            if not target.exists():  # else it may be done, and there is nothing to write
                cause = f"{target} cannot be written with its log beside it, {path}: {fault.strerror}"
                raise SweepError(cause) from None
        try:
            options = {name: getattr(arguments, name) for name in RUN_OPTIONS}
            outcome = _accounted(target, complete(study, target, **options, **solving(arguments, study)))
        except BaseException as error:
            outcome = explained(error)
            raise
        finally:
            log(f"ended with {outcome.code}: {outcome.text}", "end", exit=outcome.code)
    return outcome


def _accounted(target: Path, ending: str) -> Outcome:
    """Says what became of all cells."""
    from sweep.file.reading import StoredFile
    from sweep.file.store import unfinished_of
    from sweep.results.statuses import account, summary_text

    if ending == "not begun":
        say(text := f"{target}: unfinished; no cell is computed yet")
        return Outcome(INCOMPLETE, text)
    # read without xarray, which takes longer to load than a small run
    with StoredFile(unfinished_of(target) if ending == "unfinished" else target) as found:
        text = f"{target}: {'' if ending == 'complete' else f'{ending}; '}{summary_text(found)}"
        failed = account(found).by_kind["FAILED"]
    say(text)
    return Outcome(INCOMPLETE if ending == "unfinished" else CELLS_FAILED if failed else COMPLETE, text)


def notify(arguments: argparse.Namespace, ended: Outcome) -> None:
    """Runs the command of --notify, which finds how the run ended in its environment."""
    told = {
        "SWEEP_OUTPUT": str(arguments.output),
        "SWEEP_EXIT": str(ended.code),
        "SWEEP_MEANING": EXIT_CODES.get(ended.code, ""),
        "SWEEP_SUMMARY": ended.text,
    }
    try:
        subprocess.run(arguments.notify, shell=True, env={**os.environ, **told}, timeout=NOTIFY_SECONDS, check=True)
    except (OSError, ValueError, subprocess.SubprocessError) as fault:
        say(f"--notify: {fault}", sys.stderr)


@command(
    "sweep refine foliot.h5 --y period --tolerance 1e-3 -o fine.h5",
    o.RESULT,
    option("--y", metavar="OUTPUT", nargs="+", required=True),
    option("--tolerance", "relative interpolation error, e.g. 1e-3", metavar="SHARE", type=float, required=True),
    o.output("REFINED.h5", checked=False, required=True),
    o.FORCE,
    option("--most-cells", "largest number of cells; default: 1000000", metavar="N", type=int, default=1_000_000),
    *o.SOLVING,
)
def refine(arguments: argparse.Namespace) -> None:
    """Add cells where an output is curved, until interpolation is accurate."""
    with opened(arguments) as dataset:
        study = study_from(arguments, dataset)
        keys = {"most_cells": arguments.most_cells, "force": arguments.force, **solving(arguments, study)}
        found = sweep.refine(dataset, arguments.y, arguments.tolerance, path=arguments.output, study=study, **keys)
    say(f"{arguments.output}: {found}")


@command(
    "sweep chart foliot_scaling.toml --rtol 1e-6 1e-9",
    o.STUDY,
    o.output("FILE.png", "default: the study's name with _chart.png, here", "_chart.png"),
    o.FORCE,
    option("--methods", "default: auto and every method that can do the study", metavar="METHOD", nargs="+"),
    option("--rtol", "default: 1e-3 to 1e-13", metavar="RTOL", nargs="+", type=float),
    option("--cells", "largest number of cells; default: 1024", metavar="N", type=int, default=1024),
    option("--reference", "method taken as exact; default: the one with the smallest bound", metavar="METHOD"),
    *(switch("--all", "all tolerances, and all columns of the table"), o.JSON),
    *o.SOLVING[1:],
)
def chart(arguments: argparse.Namespace) -> None:
    """Chart error against time for every method, on cells of a study or a result."""
    from sweep.explore.work_precision import TOLERANCES, precision_text
    from sweep.runs.progress import Progress

    if arguments.study.suffix == ".h5":
        with opened(arguments, "study") as dataset:
            study = study_from(arguments, dataset)
    else:
        study = study_from(arguments)
    keys = {name: getattr(arguments, name) for name in ("methods", "cells", "reference")}
    keys |= {"tolerances": arguments.rtol or TOLERANCES, "note": Progress(1, sys.stderr, "chart").note}
    found = sweep.work_precision(study, **keys, **solving(arguments, study))
    tell(arguments, found, precision_text(found, arguments.all))
    sweep.plot(found, arguments.output, force=True)


@command(
    "sweep check foliot.h5 --sample 200",
    o.RESULT,
    option("--sample", "largest number of cells to check; default: 200", metavar="N", type=int, default=200),
    option("--seed", "seed of the random sample; default: 0", metavar="N", type=int, default=0),
    *(o.UNFINISHED, o.ALLOW_IMPORT, o.JSON),
)
def check(arguments: argparse.Namespace) -> Outcome:
    """Solve some OK cells again by another method; exit status 1 if any differs by more than its rtol."""
    with opened(arguments) as dataset:
        found = dataset.sweep.check(arguments.sample, arguments.seed, allow_import=arguments.allow_import)
    tell(arguments, found)
    return Outcome(DIFFERENT if found.beyond else COMPLETE, str(found))


@command(
    "sweep cell foliot.h5 mu=0.1",
    *(o.RESULT, option("at", 'e.g. "A0=3 degree"', metavar="AXIS=VALUE", nargs="*"), o.ALLOW_IMPORT, o.JSON),
)
def cell(arguments: argparse.Namespace) -> None:
    """Show one cell: its values, the meaning of its status, each method's result."""
    with opened(arguments) as dataset:
        found = dataset.sweep.cell(allow_import=arguments.allow_import)
    tell(arguments, found)
