"""The command that computes: run."""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from sweep.command.files import is_isolated, say, study_from
from sweep.command.options import (
    ALLOW_IMPORT,
    CELL_TIMEOUT,
    ISOLATE,
    STUDY,
    WORKERS,
    Command,
    option,
    output,
    switch,
)
from sweep.command.outcome import Outcome, explained
from sweep.errors import CELLS_FAILED, COMPLETE, EXIT_CODES, INCOMPLETE, SweepError

if TYPE_CHECKING:
    import xarray as xr

    from sweep.file.stored import Stored
    from sweep.study.model import Study

NOTIFY_SECONDS = 60
"""What the command of --notify may take."""
RUN_OPTIONS = (
    *("workers", "cluster", "force", "extend", "until"),
    *("isolate", "cell_timeout", "retry_failed", "repair"),
)
"""Options of `run` that are arguments of the function of that name."""


def _run(arguments: argparse.Namespace) -> Outcome:
    study = study_from(arguments)
    from sweep.runs.log import log, log_path, logging_to

    output = _output(arguments)
    path = log_path(output) if output.parent.is_dir() else None
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(logging_to(path, arguments.log_json))
        except OSError as fault:
            raise SweepError(f"{output} cannot be written with its log beside it, {path}: {fault.strerror}") from None
        try:
            outcome = _computed(arguments, study, output)
        except BaseException as error:
            told = explained(error)
            log(f"ended with {told.code}: {told.text}", "end", exit=told.code)
            raise
        log(f"ended with {outcome.code}: {outcome.text}", "end", exit=outcome.code)
    return outcome


def _computed(arguments: argparse.Namespace, study: Study, output: Path) -> Outcome:
    """Runs, and says what became of all cells."""
    from sweep.results.statuses import account, summary_text
    from sweep.runs.run import complete, is_begun

    before = _identity(output)
    options = {name: getattr(arguments, name) for name in RUN_OPTIONS}
    options["isolate"] = is_isolated(arguments, study)
    whole = complete(study, output, **options)
    if not whole and not is_begun(output):
        say(text := f"{output}: unfinished; no cell is computed yet")
        return Outcome(INCOMPLETE, text)
    state = "unfinished; " if not whole else "done before; " if before and _identity(output) == before else ""
    with _after(study, output, state) as found:
        text = f"{output}: {state}{summary_text(found)}"
        failed = account(found).failed
    say(text)
    return Outcome(INCOMPLETE if not whole else CELLS_FAILED if failed else COMPLETE, text)


def _after(study: Study, output: Path, state: str) -> xr.Dataset | Stored:
    """The result after a run; of one written just now without xarray, which takes longer to load than a small run."""
    if not state:
        from sweep.file.stored import Stored

        return Stored(output, study)
    from sweep.file.open import open_result, open_unfinished

    return open_unfinished(output) if state.startswith("unfinished") else open_result(output)


def _output(arguments: argparse.Namespace) -> Path:
    """Where a run writes."""
    return arguments.output or Path(f"{arguments.study.stem}.h5")


def _identity(path: Path) -> tuple[int, int] | None:
    """What changes when a file is written anew."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_ino


def notify(arguments: argparse.Namespace, ended: Outcome) -> None:
    """Runs the command of --notify, which finds how the run ended in its environment."""
    told = {
        "SWEEP_OUTPUT": str(_output(arguments)),
        "SWEEP_EXIT": str(ended.code),
        "SWEEP_MEANING": EXIT_CODES.get(ended.code, ""),
        "SWEEP_SUMMARY": ended.text,
    }
    try:
        subprocess.run(arguments.notify, shell=True, env={**os.environ, **told}, timeout=NOTIFY_SECONDS, check=True)
    except (OSError, ValueError, subprocess.SubprocessError) as fault:
        say(f"--notify: {fault}", sys.stderr)


COMMANDS = {
    "run": Command(
        "compute a study, or continue where it stopped",
        _run,
        *(STUDY, WORKERS, ALLOW_IMPORT),
        output("OUT.h5", "default: the study's name with .h5, here"),
        switch("--force", "overwrite the result of another study"),
        switch("--extend", "of a result of the same study with fewer values on its axes, compute the new cells only"),
        switch("--repair", "of a result that is damaged on the disk, compute the damaged cells again and nothing else"),
        option(
            "--cluster",
            "compute on the workers of a dask scheduler, e.g. tcp://10.0.0.1:8786, instead of here",
            metavar="ADDRESS",
        ),
        option("--until", "stop within seconds of it, with exit status 3; the same command continues", metavar="07:00"),
        *(ISOLATE, CELL_TIMEOUT),
        switch("--retry-failed", "of a complete result, compute the cells that FAILED again"),
        option("--notify", "run this at the end; $SWEEP_EXIT and $SWEEP_SUMMARY say how it ended", metavar="COMMAND"),
        switch("--log-json", "the log, OUT.h5.log, as JSON, an object a line"),
    ),
}
