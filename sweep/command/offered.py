"""What comes with foliot: kernels and studies."""

from __future__ import annotations

import argparse
from pathlib import Path

from sweep.command.files import say
from sweep.command.options import ALLOW_IMPORT, Command, option
from sweep.errors import SweepError


def _kernels(arguments: argparse.Namespace) -> None:
    from sweep.show.kernels import catalogue_text, kernel_text, write_starter

    if arguments.study and not arguments.name:
        raise SweepError("--study: name a kernel as well, e.g. sweep kernels foliot --study foliot.toml")
    if arguments.study:
        write_starter(arguments.name, arguments.study, arguments.allow_import)
        say(arguments.study)
        return
    say(kernel_text(arguments.name, arguments.allow_import) if arguments.name else catalogue_text())


def _studies(arguments: argparse.Namespace) -> None:
    from sweep.show.studies import copy_study, studies_text

    if arguments.name:
        say("\n".join(map(str, copy_study(arguments.name))))
    else:
        say(studies_text())


COMMANDS = {
    "kernels": Command(
        "what can be swept: parameters, units, outputs, methods",
        _kernels,
        option("name", "tell all about this one", metavar="NAME", nargs="?"),
        option("--study", "write a study of it to begin with", metavar="FILE.toml", type=Path),
        ALLOW_IMPORT,
    ),
    "studies": Command(
        "the studies that come with foliot; with a name: copy it here to work on",
        _studies,
        option("name", "of the study to copy", metavar="NAME", nargs="?"),
    ),
}
