"""The command that computes: run."""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from sweep.command import options as o
from sweep.command.options import command, option, switch
from sweep.command.outcome import Outcome, explained
from sweep.command.reading import say, solving, study_from
from sweep.errors import CELLS_FAILED, COMPLETE, EXIT_CODES, INCOMPLETE, SweepError

if TYPE_CHECKING:
    import xarray as xr

    from sweep.file.stored import Stored
    from sweep.study.model import Study

NOTIFY_SECONDS = 60
"""What the command of --notify may take."""
RUN_OPTIONS = ("cluster", "force", "extend", "until", "retry_failed", "repair")
"""Options of `run` that are arguments of the function of that name."""


@command(
    "sweep run foliot_scaling.toml --until 07:00",
    o.STUDY,
    o.output("OUT.h5", "default: the study's name with .h5, here"),
    switch("--force", "overwrite the result of another study"),
    switch("--extend", "of a result of the same study with fewer values on its axes, compute the new cells only"),
    switch("--repair", "of a result that is damaged on the disk, compute the damaged cells again and nothing else"),
    option(
        "--cluster",
        "compute on the workers of a dask scheduler, e.g. tcp://10.0.0.1:8786, instead of here",
        metavar="ADDRESS",
    ),
    option("--until", "stop within seconds of it, with exit status 3; the same command continues", metavar="07:00"),
    *o.SOLVING,
    switch("--retry-failed", "of a complete result, compute the cells that FAILED again"),
    option("--notify", "run this at the end; $SWEEP_EXIT and $SWEEP_SUMMARY say how it ended", metavar="COMMAND"),
    switch("--log-json", "the log, OUT.h5.log, as JSON, an object a line"),
)
def run(arguments: argparse.Namespace) -> Outcome:
    """Compute a study, or continue where it stopped."""
    study = study_from(arguments)
    from sweep.runs.log import log, log_path, logging_to

    target = output(arguments)
    path = log_path(target) if target.parent.is_dir() else None
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(logging_to(path, arguments.log_json))
        except OSError as fault:
            raise SweepError(f"{target} cannot be written with its log beside it, {path}: {fault.strerror}") from None
        try:
            outcome = _computed(arguments, study, target)
        except BaseException as error:
            told = explained(error)
            log(f"ended with {told.code}: {told.text}", "end", exit=told.code)
            raise
        log(f"ended with {outcome.code}: {outcome.text}", "end", exit=outcome.code)
    return outcome


def _computed(arguments: argparse.Namespace, study: Study, target: Path) -> Outcome:
    """Runs, and says what became of all cells."""
    from sweep.results.statuses import account, summary_text
    from sweep.runs.run import complete, is_begun

    def identity() -> tuple[int, int] | None:
        """What changes when the output is written anew."""
        try:
            return target.stat().st_mtime_ns, target.stat().st_ino
        except OSError:
            return None

    before = identity()
    options = {name: getattr(arguments, name) for name in RUN_OPTIONS}
    whole = complete(study, target, **options, **solving(arguments, study))
    if not whole and not is_begun(target):
        say(text := f"{target}: unfinished; no cell is computed yet")
        return Outcome(INCOMPLETE, text)
    state = "unfinished; " if not whole else "done before; " if before and identity() == before else ""
    if state:
        from sweep.file.open import open_result, open_unfinished

        result: xr.Dataset | Stored = open_result(target) if whole else open_unfinished(target)
    else:  # written just now: read without xarray, which takes longer to load than a small run
        from sweep.file.stored import Stored

        result = Stored(target, study)
    with result as found:
        text = f"{target}: {state}{summary_text(found)}"
        failed = account(found).failed
    say(text)
    return Outcome(INCOMPLETE if not whole else CELLS_FAILED if failed else COMPLETE, text)


def output(arguments: argparse.Namespace) -> Path:
    """Where a run writes."""
    return arguments.output or Path(f"{arguments.study.stem}.h5")


def notify(arguments: argparse.Namespace, ended: Outcome) -> None:
    """Runs the command of --notify, which finds how the run ended in its environment."""
    told = {
        "SWEEP_OUTPUT": str(output(arguments)),
        "SWEEP_EXIT": str(ended.code),
        "SWEEP_MEANING": EXIT_CODES.get(ended.code, ""),
        "SWEEP_SUMMARY": ended.text,
    }
    try:
        subprocess.run(arguments.notify, shell=True, env={**os.environ, **told}, timeout=NOTIFY_SECONDS, check=True)
    except (OSError, ValueError, subprocess.SubprocessError) as fault:
        say(f"--notify: {fault}", sys.stderr)
