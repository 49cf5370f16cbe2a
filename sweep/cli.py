"""The command `sweep`. An error that a user can act on ends in one message and an exit status, never in a traceback.

Modules are imported by the command that needs them, so that `sweep --help` is quick.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import signal
import sys
from collections.abc import Sequence
from typing import NoReturn

from sweep.command import look, solve
from sweep.command.options import command, option
from sweep.command.reading import Outcome, explained, say
from sweep.errors import COMPLETE, EXIT_CODES, MISTAKE, missing, terminate
from sweep.words import paragraph


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns
    -------
    int
        One of `EXIT_CODES`.
    """
    if argv is None and isinstance(sys.stdout, io.TextIOWrapper):  # what a terminal cannot show is written out, as \xfc
        sys.stdout.reconfigure(errors="backslashreplace")
    arguments, ended = parser().parse_args(argv), Outcome(COMPLETE, "")
    try:
        if argv is None and arguments.command is solve.run:  # which ends in its own words from the first moment on
            signal.signal(signal.SIGTERM, terminate)
        ended = arguments.command.run(arguments) or ended
        if sys.stdout is not None:  # closed by whoever has started us
            sys.stdout.flush()
    except BrokenPipeError:
        # whoever read our output has had enough; Python would complain again when it closes stdout
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (Exception, KeyboardInterrupt, SystemExit) as error:
        if os.environ.get("SWEEP_TRACEBACK"):
            raise
        ended = explained(error)
        with contextlib.suppress(OSError):  # the exit status tells of it where there is no room for words
            say(ended.text, sys.stderr)
    if getattr(arguments, "notify", None):
        solve.notify(arguments, ended)
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except OSError:  # Python would try again, and end with a status of its own
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    loop = sys.modules.get("sweep.runs.loop")
    if argv is None and loop is not None and loop.endless.is_set():
        # a kernel that never ends would keep Python from ending; a program that calls this is not ours to end
        os._exit(ended.code)
    return ended.code


@command('eval "$(sweep completion bash)"', option("shell", choices=("bash", "zsh", "tcsh")))
def completion(arguments: argparse.Namespace) -> None:
    """Print the script that makes a shell complete this command."""
    try:
        import shtab
    except ImportError:
        raise missing("completion needs shtab", "completion") from None
    print(shtab.complete(parser(), arguments.shell))


COMMANDS = {
    made.function.__name__.strip("_"): made
    for made in (
        *(look.kernels, look.studies, solve.plan, solve.run, look.show, solve.cell, solve.check, look.list_),
        *(look.verify, look.diff, look.plot, look.view, look.report, look.fit, look.exponent, look.sensitivity),
        *(solve.refine, solve.chart, look.export, look.join, completion),
    )
}
"""In the order in which `sweep --help` names them."""


class Parser(argparse.ArgumentParser):
    """One whose mistakes are as wide as any other message."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        self.exit(MISTAKE, paragraph(f"{self.prog}: error: {message}") + "\n")


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    from importlib import metadata

    try:
        version = metadata.version("foliot")
    except metadata.PackageNotFoundError:
        version = "(not installed)"
    codes = "\n".join(f"  {code:3}  {text}" for code, text in EXIT_CODES.items())
    top = Parser(
        prog="sweep",
        description="Sweep a kernel over a grid of parameters.",
        epilog=f"exit status:\n{codes}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"foliot {version}")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, one in COMMANDS.items():
        text = one.function.__doc__ or ""
        short = text[0].lower() + text[1:].rstrip(".")
        made = commands.add_parser(name, help=short, description=text, epilog=f"example: {one.example}")
        made.set_defaults(command=one)
        for names, keys, *_ in one.options:
            made.add_argument(*names, **keys)
    return top
