"""What comes with foliot: kernels and studies."""

from __future__ import annotations

import argparse
from pathlib import Path

from sweep.command import options as o
from sweep.command.options import command, option
from sweep.command.reading import say
from sweep.errors import SweepError


@command(
    "sweep kernels foliot --study foliot.toml",
    option("name", "describe this one", metavar="NAME", nargs="?"),
    option("--study", "write a study of it to begin with", metavar="FILE.toml", type=Path),
    *(o.FORCE, o.ALLOW_IMPORT, o.switch("--all", "parameters, outputs and methods of all kernels, and all statuses")),
)
def kernels(arguments: argparse.Namespace) -> None:
    """What can be swept: parameters, units, outputs, methods."""
    from sweep.show.kernels import catalogue_text, kernels, write_starter

    name, path = arguments.name, arguments.study
    if path and not name:
        raise SweepError("--study: name a kernel as well, e.g. sweep kernels foliot --study foliot.toml")
    if path:
        write_starter(name, path, arguments.allow_import, arguments.force)
    say(path or (kernels(name, arguments.allow_import) if name else catalogue_text(arguments.all)))


@command("sweep studies foliot_scaling", option("name", "of the study to copy", metavar="NAME", nargs="?"), o.FORCE)
def studies(arguments: argparse.Namespace) -> None:
    """The studies that come with foliot; with a name: copy it here to work on."""
    from sweep.show.studies import copy_study, studies_text

    name = arguments.name
    say("\n".join(map(str, copy_study(name, force=arguments.force))) if name else studies_text())
