"""The command `sweep`. Every fault that a user can act on ends in one message and an exit status, never in a traceback.

Modules are imported by the command that needs them, so that `sweep --help` is quick.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

from sweep.system.errors import CELLS_FAILED, COMPLETE, EXIT_CODES, FAULT, INCOMPLETE, INTERRUPTED, MISTAKE, SweepError

if TYPE_CHECKING:
    import xarray as xr

    from sweep.results.stored import Stored
    from sweep.study.model import Study

NOTIFY_SECONDS = 60
"""What the command of --notify may take."""
DIFFERENT = 1
"""As `diff` of files says it."""

RUN_OPTIONS = (
    *("workers", "cluster", "without_workers", "force", "extend", "until"),
    *("isolate", "cell_timeout", "retry_failed", "repair"),
)
"""Options of `run` that are arguments of the function of that name."""


class Outcome(NamedTuple):
    """How a command ended: its exit status, and what is said of it."""

    code: int
    text: str


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns
    -------
    int
        One of `EXIT_CODES`.
    """
    arguments = parser().parse_args(argv)
    ended = _ended(arguments)
    if getattr(arguments, "notify", None):
        _notify(arguments, ended)
    pool = sys.modules.get("sweep.system.pool")
    if pool is not None and pool.left_behind():
        # a kernel that never ends would keep Python from ending
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, AttributeError):
                stream.flush()
        os._exit(ended.code)
    return ended.code


def _ended(arguments: argparse.Namespace) -> Outcome:
    """Does what is asked, and says what became of it."""
    try:
        outcome: Outcome = arguments.command(arguments) or Outcome(COMPLETE, "")
        if sys.stdout is not None:  # closed by whoever has started us
            sys.stdout.flush()
        return outcome
    except BrokenPipeError:
        # whoever read our output has had enough; Python would complain again when it closes stdout
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return Outcome(COMPLETE, "")
    except (Exception, KeyboardInterrupt, SystemExit) as error:
        if os.environ.get("SWEEP_TRACEBACK"):
            raise
        outcome = _explained(error)
        with contextlib.suppress(OSError):  # the exit status tells of it where there is no room for words
            _print(outcome.text, sys.stderr)
        return outcome


def _explained(error: BaseException) -> Outcome:
    """The exit status and the message of a fault."""
    if isinstance(error, SweepError):
        return Outcome(MISTAKE, str(error))
    if isinstance(error, KeyboardInterrupt):
        return Outcome(INTERRUPTED, "stopped")
    if isinstance(error, SystemExit):
        return Outcome(int(str(error.code)), "stopped")
    if isinstance(error, MemoryError):
        return Outcome(MISTAKE, "out of memory; choose fewer cells, fewer outputs or fewer workers")
    if isinstance(error, OSError):
        return Outcome(MISTAKE, f"{error.filename or 'the system'}: {error.strerror or error}")
    return Outcome(
        FAULT,
        f"a fault in foliot: {type(error).__name__}: {error}\n"
        "Please report it; with SWEEP_TRACEBACK=1 in the environment the same command says where.",
    )


def _notify(arguments: argparse.Namespace, ended: Outcome) -> None:
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
        _print(f"--notify: {fault}", sys.stderr)


def _kernels(arguments: argparse.Namespace) -> None:
    from sweep.show.kernels import catalogue_text, kernel_text, write_starter

    if arguments.study and not arguments.name:
        raise SweepError("--study: name a kernel as well, e.g. sweep kernels foliot --study foliot.toml")
    if arguments.study:
        write_starter(arguments.name, arguments.study, arguments.allow_import)
        _print(arguments.study)
        return
    _print(kernel_text(arguments.name, arguments.allow_import) if arguments.name else catalogue_text())


def _plan(arguments: argparse.Namespace) -> None:
    from sweep.explore.plan import plan
    from sweep.system.progress import Progress

    found = plan(_study(arguments), workers=arguments.workers, note=Progress(1, sys.stderr, "plan").note)
    _print(found)
    if found.warnings:
        raise SweepError("\n".join(f"{arguments.study}: {text}" for text in found.warnings))


def _run(arguments: argparse.Namespace) -> Outcome:
    study = _study(arguments)
    from sweep.system.log import log, log_path, logging_to

    output = _output(arguments)
    for number in (signal.SIGUSR1, signal.SIGUSR2):
        # they change the number of cores while blocks are computed, and mean nothing before and after
        if threading.current_thread() is threading.main_thread() and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.SIG_IGN)
    _check_readable(output)
    with logging_to(log_path(output) if output.parent.is_dir() else None, arguments.log_json):
        try:
            outcome = _computed(arguments, study, output)
        except BaseException as error:
            told = _explained(error)
            log(f"ended with {told.code}: {told.text}", "end", exit=told.code)
            raise
        log(f"ended with {outcome.code}: {outcome.text}", "end", exit=outcome.code)
    return outcome


def _computed(arguments: argparse.Namespace, study: Study, output: Path) -> Outcome:
    """Runs, and says what became of all cells."""
    from kernels.interface import Status
    from sweep.results.statuses import summary_text, tally
    from sweep.runs.run import complete, is_begun

    before = _identity(output)
    options = {name: getattr(arguments, name) for name in RUN_OPTIONS}
    if options["isolate"] is None:
        options["isolate"] = ":" in study.kernel_name
    whole = complete(study, output, **options)
    if not whole and not is_begun(output):
        _print(text := f"{output}: unfinished; no cell is computed yet")
        return Outcome(INCOMPLETE, text)
    state = "unfinished; " if not whole else "done before; " if before and _identity(output) == before else ""
    with _after(study, output, state) as found:
        text = f"{output}: {state}{summary_text(found)}"
        failed = tally(found).get(Status.FAILED.name, 0)
    _print(text)
    return Outcome(INCOMPLETE if not whole else CELLS_FAILED if failed else COMPLETE, text)


def _output(arguments: argparse.Namespace) -> Path:
    """Where a run writes."""
    return arguments.output or Path(f"{arguments.study.stem}.h5")


def _after(study: Study, output: Path, state: str) -> xr.Dataset | Stored:
    """The result after a run; of one written just now without xarray, which takes longer to load than a small run."""
    if not state:
        from sweep.results.stored import Stored

        return Stored(output, study)
    from sweep.results.open import open_result, open_unfinished

    return open_unfinished(output) if state.startswith("unfinished") else open_result(output)


def _show(arguments: argparse.Namespace) -> None:
    from sweep.show.follow import follow
    from sweep.show.text import result_text

    with _result(arguments) as dataset:
        _print(result_text(arguments.result, dataset))
    if arguments.follow:
        for line in follow(arguments.result):
            _print(line)
            sys.stdout.flush()


def _verify(arguments: argparse.Namespace) -> None:
    from sweep.results.verify import verify

    _check_readable(arguments.result)
    verdict = verify(arguments.result)
    if not verdict.whole:
        raise SweepError(str(verdict))
    _print(verdict)


def _fit(arguments: argparse.Namespace) -> None:
    from sweep.analysis.scattered import on_lines
    from sweep.show.laws import laws, laws_text, pick, write_laws

    if arguments.compare:
        _compare(arguments)
        return
    if arguments.output:
        _check_target(arguments, arguments.output, "laws")
    with _result(arguments) as dataset:
        part = on_lines(pick(dataset, arguments.at), arguments.x)
        noise = {"yes": True, "no": False}.get(arguments.noise, arguments.noise)
        found = laws(part, arguments.y, arguments.x, arguments.window or [], arguments.confidence, noise)
    _print(laws_text(found))
    if arguments.output:
        write_laws(found, arguments.output)
        _print(arguments.output)


def _compare(arguments: argparse.Namespace) -> None:
    """`sweep fit --compare`: a table, and a picture or csv of it."""
    from sweep.analysis.scattered import on_lines
    from sweep.show.compare import comparison, comparison_text, write_comparison
    from sweep.show.laws import pick

    target = arguments.output
    drawn = target is not None and target.suffix.lower() != ".csv"
    if target:
        _check_target(arguments, target, None if drawn else "laws")
    with _result(arguments) as dataset:
        part = on_lines(pick(dataset, arguments.at), arguments.x)
        found = comparison(part, arguments.y, arguments.x, arguments.window or [])
    _print(comparison_text(found))
    if drawn:
        from sweep.show.law_charts import plot_laws

        plot_laws(found, target)
    elif target:
        write_comparison(found, target)
    if target:
        _print(target)


def _plot(arguments: argparse.Namespace) -> None:
    from sweep.show.charts import plot
    from sweep.show.laws import pick

    output = arguments.output or Path(f"{arguments.result.stem}.png")
    _check_target(arguments, output)
    with _result(arguments) as dataset:
        plot(_in_units(pick(dataset, arguments.at), arguments.unit), output, y=arguments.y, x=arguments.x)
    _print(output)


def _view(arguments: argparse.Namespace) -> None:
    from sweep.view.server import serve

    with _result(arguments):
        serve(arguments.result, arguments.port, not arguments.no_browser)


def _chart(arguments: argparse.Namespace) -> None:
    from sweep.explore.work_precision import TOLERANCES, precision_text, work_precision
    from sweep.show.charts import plot_precision

    study = _study_of_result(arguments) if arguments.study.suffix == ".h5" else _study(arguments)
    output = arguments.output or Path(f"{arguments.study.stem}_chart.png")
    _check_target(arguments, output)
    found = work_precision(
        study,
        methods=arguments.methods,
        tolerances=arguments.rtol or TOLERANCES,
        cells=arguments.cells,
        reference=arguments.reference,
    )
    _print(precision_text(found))
    plot_precision(found, output)
    _print(output)


def _refine(arguments: argparse.Namespace) -> None:
    from sweep.explore.refine import refine, study_of

    _check_target(arguments, arguments.output, "result")
    with _result(arguments) as dataset:
        study = study_of(dataset, allow_import=arguments.allow_import)
        found = refine(
            dataset,
            arguments.y,
            arguments.tolerance,
            path=arguments.output,
            study=study,
            most_cells=arguments.most_cells,
            workers=arguments.workers,
            force=arguments.force,
        )
    _print(f"{arguments.output}: {found}")


def _report(arguments: argparse.Namespace) -> None:
    from sweep.show.page import write_page

    output = arguments.output or Path(f"{arguments.result.stem}.html")
    _check_target(arguments, output, "page")
    with _result(arguments) as dataset:
        _print(write_page(_in_units(dataset, arguments.unit), arguments.result, output))


def _export(arguments: argparse.Namespace) -> None:
    from sweep.results.export import export
    from sweep.results.filter import where

    _check_target(arguments, arguments.output)
    with _result(arguments) as dataset:
        chosen = dataset if arguments.where is None else where(dataset, arguments.where)
        keys = {name: getattr(arguments, name) for name in ("force", "compress", "float32")}
        _print(export(_in_units(chosen, arguments.unit), arguments.output, **keys))


def _studies(arguments: argparse.Namespace) -> None:
    from sweep.show.studies import copy_study, studies_text

    if arguments.name:
        _print("\n".join(map(str, copy_study(arguments.name))))
    else:
        _print(studies_text())


def _completion(arguments: argparse.Namespace) -> None:
    try:
        import shtab
    except ImportError:
        raise SweepError('completion needs shtab; install it with: pip install "foliot[completion]"') from None
    print(shtab.complete(parser(), arguments.shell))


def _diff(arguments: argparse.Namespace) -> Outcome:
    from sweep.results.diff import diff

    with _opened(arguments.result) as a, _opened(arguments.other) as b:
        found = diff(a, b, arguments.rtol)
    _print(found)
    return Outcome(COMPLETE if found.same else DIFFERENT, str(found))


def _join(arguments: argparse.Namespace) -> None:
    from sweep.explore.join import join
    from sweep.results.statuses import summary_text

    paths = [arguments.result, arguments.other]
    _check_target(arguments, arguments.output, "result")
    labels = arguments.labels or [path.stem if len({p.stem for p in paths}) > 1 else str(path) for path in paths]
    with _opened(paths[0]) as a, _opened(paths[1]) as b:
        found = join(a, b, arguments.output, axis=arguments.axis, labels=labels, force=arguments.force)
    with found:
        _print(f"{arguments.output}: {summary_text(found)}")


def _list(arguments: argparse.Namespace) -> None:
    from sweep.results.listing import list_results

    _print(list_results(arguments.folder))


def _in_units(dataset: xr.Dataset, given: Sequence[str]) -> xr.Dataset:
    from sweep.results.units import in_units

    for text in given:
        if not all(text.partition("=")):
            raise SweepError(f'--unit: expected NAME=UNIT, found "{text}"; write e.g. --unit A0=degree')
    return in_units(dataset, {name: unit for name, _, unit in (text.partition("=") for text in given)})


def _study(arguments: argparse.Namespace) -> Study:
    from sweep.study.read import read_study

    path = arguments.study
    return read_study(path, allow_import=arguments.allow_import)


def _study_of_result(arguments: argparse.Namespace) -> Study:
    from sweep.explore.refine import study_of

    with _opened(arguments.study) as dataset:
        return study_of(dataset, allow_import=arguments.allow_import)


def _result(arguments: argparse.Namespace) -> contextlib.AbstractContextManager[xr.Dataset]:
    return _opened(arguments.result, getattr(arguments, "unfinished", True))


@contextlib.contextmanager
def _opened(path: Path, unfinished: bool = True) -> Iterator[xr.Dataset]:
    """A result; where another program has changed it, what goes wrong with it is told as that."""
    from sweep.results.open import changed, open_result

    if path.suffix == ".toml":
        raise SweepError(f"{path} is a study, not a result; compute it with: sweep run {path}")
    if not path.exists() and path.with_name(path.name + ".unfinished").exists():
        _print(f"{path}: unfinished; cells that are not computed yet are NaN and PENDING", file=sys.stderr)
    _check_readable(path, "xarray")
    with open_result(path) as found, changed(path):
        if "end" not in found.attrs and not unfinished:
            raise SweepError(f"{path}: unfinished; continue it with sweep run, or take what there is with --unfinished")
        yield found


def _check_target(arguments: argparse.Namespace, target: Path, kind: str | None = None) -> None:
    """Raises SweepError where a command is not to write there; its kind is the suffix unless it has a name."""
    from sweep.system.overwriting import check_target

    read = [getattr(arguments, name) for name in ("result", "study") if name in arguments]
    check_target(target, kind or target.suffix.lower(), force=arguments.force, read=read)


def _check_readable(path: Path, *meanwhile: str) -> None:
    """Raises SweepError where HDF5 hangs or crashes in a result although its trailer is right: then it is forged.

    A result that is not intact, or not there, is looked at by who opens it.

    Parameters
    ----------
    meanwhile : names of modules to import while another process reads the result
    """
    from sweep.results.open import unreadable
    from sweep.store.probe import intact, probing

    if not intact(path):
        return
    read = probing(path)
    for name in meanwhile:
        import_module(name)
    if not read():
        raise unreadable(path, ValueError("HDF5 cannot read it"))


def _identity(path: Path) -> tuple[int, int] | None:
    """What changes when a file is written anew."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_ino


def _print(text: object, file: TextIO | None = None) -> None:
    """Prints, to stdout unless said otherwise, what may hold text of other people."""
    from sweep.system.table import printable

    print(printable(str(text)), file=file)


def _version() -> str:
    from importlib import metadata

    try:
        return f"foliot {metadata.version('foliot')}"
    except metadata.PackageNotFoundError:
        return "foliot (not installed)"


class Option(NamedTuple):
    """What argparse's `add_argument` takes."""

    names: tuple[str, ...]
    keys: dict[str, Any]


def option(name: str, text: str | None = None, **keys: Any) -> Option:
    """An option, or an argument where the name has no dash."""
    return Option(tuple(name.split()), {"help": text, **keys})


def switch(name: str, text: str) -> Option:
    """An option without a value."""
    return option(name, text, action="store_true")


def several(name: str, text: str, metavar: str) -> Option:
    """An option with values, which may be given again."""
    return option(name, text, metavar=metavar, nargs="+", action="extend", default=[])


def output(metavar: str, text: str | None = None, required: bool = False) -> Option:
    """Where a command writes."""
    return option("-o --output", text, metavar=metavar, type=Path, required=required)


class Command(NamedTuple):
    """One command: what it is for, what does it, and what may stand behind its name."""

    text: str
    function: Callable[[argparse.Namespace], Outcome | None]
    options: tuple[Option, ...]

    @classmethod
    def of(cls, text: str, function: Callable[[argparse.Namespace], Outcome | None], *options: Option) -> Command:
        return cls(text, function, options)


STUDY = option("study", metavar="STUDY.toml", type=Path)
RESULT = option("result", metavar="OUT.h5", type=Path)
OTHER = option("other", metavar="OTHER.h5", type=Path)
WORKERS = option("--workers", "cores to use; default: all; SIGUSR1 adds one, SIGUSR2 takes one", metavar="N", type=int)
ALLOW_IMPORT = switch("--allow-import", 'allow a kernel "module:NAME" of your own')
FORCE = switch("--force", "overwrite what is there even if it is not from an earlier command of this kind")
UNFINISHED = switch("--unfinished", "take what there is of a result that is not complete yet")
AT = several("--at", "pick one value of another axis", "AXIS=VALUE")
UNITS = several("--unit", "give a variable in another unit, e.g. A0=degree e=mm wear=mm/hour", "NAME=UNIT")

COMMANDS = {
    "kernels": Command.of(
        "what can be swept: parameters, units, outputs, methods",
        _kernels,
        option("name", "tell all about this one", metavar="NAME", nargs="?"),
        option("--study", "write a study of it to begin with", metavar="FILE.toml", type=Path),
        ALLOW_IMPORT,
    ),
    "plan": Command.of(
        "cells, bytes, memory and a timed forecast, before anything runs", _plan, STUDY, WORKERS, ALLOW_IMPORT
    ),
    "run": Command.of(
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
        option(
            "--isolate",
            "solve cells in processes of their own, so that one that crashes or never ends costs only itself; "
            'default: for a kernel "module:NAME"',
            action=argparse.BooleanOptionalAction,
        ),
        option(
            "--cell-timeout",
            "what a cell may take, e.g. 90s or 1h; default: 60s, longer where cells do",
            metavar="TIME",
        ),
        switch("--retry-failed", "of a complete result, compute the cells that FAILED again"),
        option(
            "--without-workers",
            "where a cluster has none, or loses all: wait (the default), go on here after ten seconds, or end",
            choices=("wait", "here", "end"),
            default="wait",
        ),
        option("--notify", "run this at the end; $SWEEP_EXIT and $SWEEP_SUMMARY say how it ended", metavar="COMMAND"),
        switch("--log-json", "the log, OUT.h5.log, as JSON, an object a line"),
    ),
    "show": Command.of(
        "what is in a result, how much is done, what became of its cells",
        _show,
        RESULT,
        switch("--follow", "then tell how the run goes on until it ends, from its log, on any machine that sees it"),
    ),
    "verify": Command.of("whether a result, finished or not, is what was written", _verify, RESULT),
    "fit": Command.of(
        "exponent of a power law, and where two laws meet",
        _fit,
        RESULT,
        option("--y", metavar="OUTPUT", required=True),
        option("--x", metavar="AXIS", required=True),
        option(
            "--window",
            "part of the axis to fit over; given twice, also tells where the two laws meet",
            nargs=2,
            type=float,
            metavar=("LO", "HI"),
            action="append",
        ),
        option("--confidence", "of the intervals; default: 0.95", type=float, default=0.95, metavar="SHARE"),
        option(
            "--noise",
            "whether the values scatter, or how; default: as tests find",
            choices=("yes", "no", "independent", "uneven", "correlated", "outliers"),
        ),
        switch("--compare", "which law: one, two or three, a logarithm, an offset, a correction to scaling"),
        output("FILE.csv|.png", "also write the table; with --compare, .png, .svg or .pdf is a picture of all laws"),
        *(FORCE, AT, UNFINISHED),
    ),
    "plot": Command.of(
        "a figure of one output",
        _plot,
        RESULT,
        output("FILE.png", "default: the result's name with .png, here"),
        FORCE,
        option("--y", "default: the first output", metavar="OUTPUT"),
        option("--x", "default: the first axis", metavar="AXIS"),
        *(AT, UNITS),
    ),
    "view": Command.of(
        "look at a result in the browser: any two axes, sliders for the others",
        _view,
        RESULT,
        option("--port", "of this machine; default: a free one", metavar="N", type=int, default=0),
        switch("--no-browser", "only say where the page is"),
    ),
    "chart": Command.of(
        "error against time of every method of a kernel, on the cells of a study or a result",
        _chart,
        STUDY,
        output("FILE.png", "default: the study's name with _chart.png, here"),
        FORCE,
        option("--methods", "default: auto and all that can do the study", metavar="METHOD", nargs="+"),
        option("--rtol", "default: 1e-3 to 1e-13", metavar="RTOL", nargs="+", type=float),
        option("--cells", "of the study at most; default: 1024", metavar="N", type=int, default=1024),
        option("--reference", "taken for the truth; default: the one with the best bound", metavar="METHOD"),
        ALLOW_IMPORT,
    ),
    "refine": Command.of(
        "add cells to a result where it bends, until it can be interpolated",
        _refine,
        RESULT,
        option("--y", metavar="OUTPUT", nargs="+", required=True),
        option("--tolerance", "relative, e.g. 1e-3", metavar="SHARE", type=float, required=True),
        output("REFINED.h5", required=True),
        FORCE,
        option("--most-cells", "altogether; default: 1000000", metavar="N", type=int, default=1_000_000),
        *(WORKERS, ALLOW_IMPORT),
    ),
    "report": Command.of(
        "one self-contained page of HTML: figures, exponents, provenance",
        _report,
        RESULT,
        output("FILE.html", "default: the result's name with .html, here"),
        *(FORCE, UNITS, UNFINISHED),
    ),
    "studies": Command.of(
        "the studies that come with foliot; with a name: copy it here to work on",
        _studies,
        option("name", "of the study to copy", metavar="NAME", nargs="?"),
    ),
    "completion": Command.of(
        'what makes a shell complete the command, e.g. eval "$(sweep completion bash)"',
        _completion,
        option("shell", choices=("bash", "zsh", "tcsh")),
    ),
    "diff": Command.of(
        "in what two results differ: cells, statuses, how far; exit status 1 where they do",
        _diff,
        *(RESULT, OTHER),
        option("--rtol", "relative distance that is none; default: 0", metavar="SHARE", type=float, default=0.0),
    ),
    "join": Command.of(
        "two results of one kernel as one, longer along an axis or along a new one",
        _join,
        *(RESULT, OTHER),
        output("JOINED.h5", required=True),
        FORCE,
        option("--axis", 'name of a new axis, e.g. "version"', metavar="NAME"),
        option("--labels", "its values; default: the names of the files", metavar="LABEL", nargs=2),
    ),
    "list": Command.of(
        "the results in a folder: question, cells, how much is done, statuses, when, version",
        _list,
        option("folder", "default: here", metavar="FOLDER", type=Path, nargs="?", default=Path()),
    ),
    "export": Command.of(
        "write a result as csv, parquet, netCDF4 or zarr",
        _export,
        RESULT,
        output("FILE.csv|.parquet|.nc|.zarr", required=True),
        FORCE,
        option("--where", "only cells for which this holds, e.g. \"status == 'OK' and R < 0.1\"", metavar="CONDITION"),
        switch("--compress", "of netCDF4 and zarr: smaller, every bit kept"),
        switch("--float32", "of netCDF4 and zarr: outputs with 24 bits of precision"),
        *(UNITS, UNFINISHED),
    ),
}


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    codes = "\n".join(f"  {code:3}  {text}" for code, text in EXIT_CODES.items())
    top = argparse.ArgumentParser(
        prog="sweep",
        description="Sweep a kernel over a grid of parameters.",
        epilog=f"exit status:\n{codes}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=_version())
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, (text, function, options) in COMMANDS.items():
        command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        command.set_defaults(command=function)
        for names, keys in options:
            command.add_argument(*names, **keys)
    return top


if __name__ == "__main__":
    sys.exit(main())
