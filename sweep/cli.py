"""The command `sweep`. Every fault that a user can act on ends in one message and exit status 2, never in a traceback.

Modules are imported by the command that needs them, so that `sweep --help` is quick.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from sweep.system.errors import SweepError

if TYPE_CHECKING:
    import xarray as xr

    from sweep.results.stored import Stored
    from sweep.study.model import Study

OK, FAULT, MISTAKE, INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns
    -------
    int
        0, also where `--until` ended a run; 2 for a mistake of the user or a fault of the machine; 130 after Ctrl-C,
        143 after SIGTERM; 1 for a fault of ours.
    """
    arguments = parser().parse_args(argv)
    try:
        arguments.command(arguments)
        sys.stdout.flush()
    except SweepError as error:
        return _fail(str(error), MISTAKE)
    except KeyboardInterrupt:
        return _fail("stopped", INTERRUPTED)
    except SystemExit as end:
        # after SIGTERM
        return _fail("stopped", int(str(end.code)))
    except BrokenPipeError:
        # whoever read our output has had enough; Python would complain again when it closes stdout
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except MemoryError:
        return _fail("out of memory; choose fewer cells, fewer outputs or fewer workers", MISTAKE)
    except OSError as error:
        return _fail(f"{error.filename or 'the system'}: {error.strerror or error}", MISTAKE)
    except Exception as error:
        if os.environ.get("SWEEP_TRACEBACK"):
            raise
        return _fail(
            f"a fault in foliot: {type(error).__name__}: {error}\n"
            "Please report it; with SWEEP_TRACEBACK=1 in the environment the same command says where.",
            FAULT,
        )
    return OK


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    top = argparse.ArgumentParser(prog="sweep", description="Sweep a kernel over a grid of parameters.")
    top.add_argument("--version", action="version", version=_version())
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    kernels = _command(commands, "kernels", _kernels, "what can be swept: parameters, units, outputs, methods")
    kernels.add_argument("name", metavar="NAME", nargs="?", help="tell all about this one")
    kernels.add_argument("--study", metavar="FILE.toml", type=Path, help="write a study of it to begin with")
    _add_allow_import(kernels)

    plan = _command(commands, "plan", _plan, "cells, bytes, memory and a timed forecast, before anything runs")
    _add_study(plan)

    run = _command(commands, "run", _run, "compute a study, or continue where it stopped")
    _add_study(run)
    run.add_argument("-o", "--output", metavar="OUT.h5", type=Path, help="default: the study's name with .h5, here")
    run.add_argument("--force", action="store_true", help="overwrite the result of another study")
    text = "of a result of the same study with fewer values on its axes, compute the new cells only"
    run.add_argument("--extend", action="store_true", help=text)
    text = "compute on the workers of a dask scheduler, e.g. tcp://10.0.0.1:8786, instead of here"
    run.add_argument("--cluster", metavar="ADDRESS", help=text)
    text = "stop within a block's time of it, exit status 0; the same command continues"
    run.add_argument("--until", metavar="07:00", help=text)

    show = _command(commands, "show", _show, "what is in a result, how much is done, what became of its cells")
    _add_result(show)

    verify = _command(commands, "verify", _verify, "whether a result, finished or not, is what was written")
    _add_result(verify)

    fit = _command(commands, "fit", _fit, "exponent of a power law, and where two laws meet")
    _add_result(fit)
    fit.add_argument("--y", metavar="OUTPUT", required=True)
    fit.add_argument("--x", metavar="AXIS", required=True)
    window = "part of the axis to fit over; given twice, also tells where the two laws meet"
    fit.add_argument("--window", nargs=2, type=float, metavar=("LO", "HI"), action="append", help=window)
    fit.add_argument("--confidence", type=float, default=0.95, metavar="SHARE", help="of the intervals; default: 0.95")
    text = "whether the values carry independent noise; default: as their scatter shows"
    fit.add_argument("--noise", choices=("yes", "no"), help=text)
    fit.add_argument("-o", "--output", metavar="FILE.csv", type=Path, help="also write the table")
    _add_force(fit)
    _add_at(fit)

    plot = _command(commands, "plot", _plot, "a figure of one output")
    _add_result(plot)
    plot.add_argument(
        "-o", "--output", metavar="FILE.png", type=Path, help="default: the result's name with .png, here"
    )
    _add_force(plot)
    plot.add_argument("--y", metavar="OUTPUT", help="default: the first output")
    plot.add_argument("--x", metavar="AXIS", help="default: the first axis")
    _add_at(plot)
    _add_units(plot)

    chart = _command(
        commands, "chart", _chart, "error against time of every method of a kernel, on the cells of a study"
    )
    chart.add_argument("study", metavar="STUDY.toml", type=Path)
    chart.add_argument(
        "-o", "--output", metavar="FILE.png", type=Path, help="default: the study's name with _chart.png, here"
    )
    _add_force(chart)
    chart.add_argument("--methods", metavar="METHOD", nargs="+", help="default: auto and all that can do the study")
    chart.add_argument("--rtol", metavar="RTOL", nargs="+", type=float, help="default: 1e-3 to 1e-13")
    chart.add_argument("--cells", metavar="N", type=int, default=1024, help="of the study at most; default: 1024")
    chart.add_argument(
        "--reference", metavar="METHOD", help="taken for the truth; default: the one with the best bound"
    )
    _add_allow_import(chart)

    refine = _command(commands, "refine", _refine, "add cells to a result where it bends, until it can be interpolated")
    _add_result(refine)
    refine.add_argument("--y", metavar="OUTPUT", nargs="+", required=True)
    refine.add_argument("--tolerance", metavar="SHARE", type=float, required=True, help="relative, e.g. 1e-3")
    refine.add_argument("-o", "--output", metavar="REFINED.h5", type=Path, required=True)
    _add_force(refine)
    refine.add_argument("--most-cells", metavar="N", type=int, default=1_000_000, help="altogether; default: 1000000")
    refine.add_argument("--workers", metavar="N", type=int, help="cores to use; default: all")
    _add_allow_import(refine)

    report = _command(commands, "report", _report, "one self-contained page of HTML: figures, exponents, provenance")
    _add_result(report)
    report.add_argument(
        "-o", "--output", metavar="FILE.html", type=Path, help="default: the result's name with .html, here"
    )
    _add_force(report)
    _add_units(report)

    export = _command(commands, "export", _export, "write a result as csv, parquet, netCDF4 or zarr")
    _add_result(export)
    export.add_argument("-o", "--output", metavar="FILE.csv|.parquet|.nc|.zarr", type=Path, required=True)
    _add_force(export)
    text = "only cells for which this holds, e.g. \"status == 'OK' and R < 0.1\""
    export.add_argument("--where", metavar="CONDITION", help=text)
    _add_units(export)
    return top


def _command(commands: Any, name: str, function: Callable[[argparse.Namespace], None], text: str) -> Any:
    command = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    command.set_defaults(command=function)
    return command


def _add_study(command: Any) -> None:
    command.add_argument("study", metavar="STUDY.toml", type=Path)
    command.add_argument("--workers", metavar="N", type=int, help="cores to use; default: all")
    _add_allow_import(command)


def _add_result(command: Any) -> None:
    command.add_argument("result", metavar="OUT.h5", type=Path)


def _add_allow_import(command: Any) -> None:
    command.add_argument("--allow-import", action="store_true", help='allow a kernel "module:NAME" of your own')


def _add_force(command: Any) -> None:
    text = "overwrite what is there even if it is not from an earlier command of this kind"
    command.add_argument("--force", action="store_true", help=text)


def _add_at(command: Any) -> None:
    command.add_argument(
        "--at", metavar="AXIS=VALUE", nargs="+", action="extend", default=[], help="pick one value of another axis"
    )


def _add_units(command: Any) -> None:
    text = "give a variable in another unit, e.g. A0=degree e=mm wear=mm/hour"
    command.add_argument("--unit", metavar="NAME=UNIT", nargs="+", action="extend", default=[], help=text)


def _kernels(arguments: argparse.Namespace) -> None:
    from sweep.show.kernels import catalogue_text, kernel_text, write_starter

    if arguments.study and not arguments.name:
        raise SweepError("--study: name a kernel as well, e.g. sweep kernels foliot --study foliot.toml")
    if arguments.study:
        write_starter(arguments.name, arguments.study, arguments.allow_import)
        _tell(arguments.study)
        return
    _tell(kernel_text(arguments.name, arguments.allow_import) if arguments.name else catalogue_text())


def _plan(arguments: argparse.Namespace) -> None:
    from sweep.explore.plan import plan
    from sweep.system.progress import Progress

    found = plan(_study(arguments), workers=arguments.workers, note=Progress(1, sys.stderr, "plan").note)
    _tell(found)
    if found.warnings:
        raise SweepError("\n".join(f"{arguments.study}: {text}" for text in found.warnings))


def _run(arguments: argparse.Namespace) -> None:
    study = _study(arguments)
    from sweep.results.statuses import summary_text
    from sweep.runs.run import complete

    output = arguments.output or Path(f"{arguments.study.stem}.h5")
    _check_readable(output)
    before = _mark(output)
    options = {name: getattr(arguments, name) for name in ("workers", "cluster", "force", "extend", "until")}
    whole = complete(study, output, **options)
    told = "unfinished; " if not whole else "done before; " if before and _mark(output) == before else ""
    with _after(study, output, told) as found:
        _tell(f"{output}: {told}{summary_text(found)}")


def _after(study: Study, output: Path, told: str) -> xr.Dataset | Stored:
    """The result after a run; of one written just now without xarray, which takes longer to load than a small run."""
    if not told:
        from sweep.results.stored import Stored

        return Stored(output, study)
    from sweep.results.open import open_result, open_unfinished

    return open_unfinished(output) if told.startswith("unfinished") else open_result(output)


def _show(arguments: argparse.Namespace) -> None:
    from sweep.show.text import result_text

    with _result(arguments) as dataset:
        _tell(result_text(arguments.result, dataset))


def _verify(arguments: argparse.Namespace) -> None:
    from sweep.results.verify import verify

    _check_readable(arguments.result)
    verdict = verify(arguments.result)
    if not verdict.whole:
        raise SweepError(str(verdict))
    _tell(verdict)


def _fit(arguments: argparse.Namespace) -> None:
    from sweep.show.laws import laws, laws_text, pick, write_laws

    if arguments.output:
        _check_target(arguments, arguments.output, "laws")
    with _result(arguments) as dataset:
        part = pick(dataset, arguments.at)
        noise = {None: None, "yes": True, "no": False}[arguments.noise]
        found = laws(part, arguments.y, arguments.x, arguments.window or [], arguments.confidence, noise)
    _tell(laws_text(found))
    if arguments.output:
        write_laws(found, arguments.output)
        _tell(arguments.output)


def _plot(arguments: argparse.Namespace) -> None:
    from sweep.show.charts import plot
    from sweep.show.laws import pick

    output = arguments.output or Path(f"{arguments.result.stem}.png")
    _check_target(arguments, output)
    with _result(arguments) as dataset:
        plot(_in_units(pick(dataset, arguments.at), arguments.unit), output, y=arguments.y, x=arguments.x)
    _tell(output)


def _chart(arguments: argparse.Namespace) -> None:
    from sweep.explore.work_precision import TOLERANCES, precision_text, work_precision
    from sweep.show.charts import plot_precision

    study = _study(arguments)
    output = arguments.output or Path(f"{arguments.study.stem}_chart.png")
    _check_target(arguments, output)
    found = work_precision(
        study,
        methods=arguments.methods,
        tolerances=arguments.rtol or TOLERANCES,
        cells=arguments.cells,
        reference=arguments.reference,
    )
    _tell(precision_text(found))
    plot_precision(found, output)
    _tell(output)


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
    _tell(f"{arguments.output}: {found}")


def _report(arguments: argparse.Namespace) -> None:
    from sweep.show.page import write_page

    output = arguments.output or Path(f"{arguments.result.stem}.html")
    _check_target(arguments, output, "page")
    with _result(arguments) as dataset:
        _tell(write_page(_in_units(dataset, arguments.unit), arguments.result, output))


def _export(arguments: argparse.Namespace) -> None:
    from sweep.results.export import export
    from sweep.results.filter import where

    _check_target(arguments, arguments.output)
    with _result(arguments) as dataset:
        chosen = dataset if arguments.where is None else where(dataset, arguments.where)
        _tell(export(_in_units(chosen, arguments.unit), arguments.output, force=arguments.force))


def _in_units(dataset: xr.Dataset, given: Sequence[str]) -> xr.Dataset:
    from sweep.results.units import in_units

    for text in given:
        if not all(text.partition("=")):
            raise SweepError(f'--unit: expected NAME=UNIT, found "{text}"; write e.g. --unit A0=degree')
    return in_units(dataset, {name: unit for name, _, unit in (text.partition("=") for text in given)})


def _study(arguments: argparse.Namespace) -> Study:
    from sweep.study.read import read_study

    path = arguments.study
    if path.suffix == ".py":
        raise SweepError(f"{path} is a study in Python; run it with: python {path}")
    if path.suffix in (".h5", ".nc"):
        raise SweepError(f"{path} is a result, not a study; look at it with: sweep show {path}")
    return read_study(path, allow_import=arguments.allow_import)


def _result(arguments: argparse.Namespace) -> xr.Dataset:
    from sweep.results.open import open_result

    path = arguments.result
    if path.suffix == ".toml":
        raise SweepError(f"{path} is a study, not a result; compute it with: sweep run {path}")
    if not path.exists() and path.with_name(path.name + ".parts").is_dir():
        _tell(f"{path}: unfinished; cells that are not computed yet are NaN and PENDING", file=sys.stderr)
    _check_readable(path, "xarray")
    return open_result(path)


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


def _mark(path: Path) -> tuple[int, int] | None:
    """What changes when a file is written anew."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_ino


def _tell(text: object, file: TextIO | None = None) -> None:
    """Prints, to stdout unless said otherwise, what may hold text of other people."""
    from sweep.system.table import printable

    print(printable(str(text)), file=file)


def _fail(message: str, code: int) -> int:
    _tell(message, sys.stderr)
    return code


def _version() -> str:
    from importlib import metadata

    try:
        return f"foliot {metadata.version('foliot')}"
    except metadata.PackageNotFoundError:
        return "foliot (not installed)"


if __name__ == "__main__":
    sys.exit(main())
