"""Nonsense for studies and results; shared by tests and the soak script."""

from __future__ import annotations

import contextlib
import io
import random
import re
import shutil
import tomllib
from collections.abc import Sequence
from pathlib import Path

from havoc import flip, study

from sweep.cells.fingerprint import fingerprint
from sweep.cli import main
from sweep.errors import SweepError
from sweep.runs.run import run
from sweep.study.read import study as as_study
from sweep.study.read import to_toml

STUDY = """# How fast does a stone fall?
title = "Stones"
kernel = "toy:KERNEL"
method = "auto"
rtol = 1e-3
outputs = ["fall_time", "drop"]
design = "product"
[axes.height]
spacing = "log"
start = 1
stop = 1000
num = 31
unit = "m"
[axes.v0]
values = [0.0, 1.0, -1.0, nan]
[fixed]
g = { value = 9.8, unit = "m/s^2" }
[along.phase]
num = 5
[summary]
over = ["v0"]
outputs.fall_time = ["min", "histogram"]
[summary.edges.fall_time]
spacing = "linear"
start = 0
stop = 10
num = 11
"""

WORDS = [
    *"=[]{}'\",.#\n\x00", "nan", "inf", "-inf", "0", "-1", "1e308", "1e-320", "1e999", "9" * 30, "0x10", "true",
    "1979-05-27", "07:32:00", "axes", "fixed", "along", "summary", "kernel", "method", "rtol", "outputs", "design",
    "num", "start", "stop", "unit", "spacing", "values", "file", "over", "edges", '"zip"', '"sobol"', '"log"',
    '"degree"', '"kg"', '"m**m"', '"1/0"', '"lambda"', "\"__import__('os')\"", '"../../../etc/passwd"', '"/dev/zero"',
    '"toy:KERNEL"', '"os:system"', '"toy:RICH"', '"foliot"', "[[]]", "{}", "[axes.height]", "[axes.method]",
    "[axes.rtol]", "[fixed]", "\u2028", "é", "😀",
]  # fmt: skip


NUMBERS = ["0", "-0.0", "1", "-1", "2", "3", "0.5", "1e-9", "1e-30", "1e-300", "5e-324", "1e9", "1e30", "1e300",
           "1e308", "-1e300", "nan", "inf", "-inf", "1000000", "2147483648", "9223372036854775807", "1.5"]  # fmt: skip
TABLES = ("axes", "fixed", "along", "summary", "summary.outputs", "summary.edges", "axes.mu", "axes.method", "[blocks]")


def nonsense(rng: random.Random, text: str) -> str:
    """The text with some pieces cut, doubled, swapped, or replaced by words of the trade."""
    for _ in range(rng.choice([1, 1, 1, 2, 5])):
        begin = rng.randrange(len(text) + 1)
        end = min(len(text), begin + rng.choice([0, 1, 1, 3, 10, 40]))
        piece = rng.choice([
            "", rng.choice(WORDS), text[begin:end] * 2, chr(rng.randrange(1, 0xD7FF)), str(rng.uniform(-1e3, 1e3)),
            "[" * rng.choice([1, 5, 3000]), f"{rng.choice(WORDS)} = {rng.choice(WORDS)}\n",
        ])  # fmt: skip
        text = text[:begin] + piece + text[end:]
    return text


def varied(rng: random.Random, texts: Sequence[str]) -> str:
    """One of the studies with some lines changed, most of them so that TOML can still be read."""
    lines = rng.choice(texts).splitlines()
    others = [line for text in texts for line in text.splitlines() if "=" in line]
    for _ in range(rng.choice([1, 1, 2, 4])):
        at = rng.choice([k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")] or [0])
        key, equals, value = lines[at].partition("=")
        number = re.sub(r"-?\d[\d.e+-]*", lambda _: rng.choice(NUMBERS), lines[at], count=rng.choice([1, 1, 0]))
        lines[at] = rng.choice([
            "", f"{lines[at]}\n{lines[at]}", rng.choice(others), number, number, number,
            f"{key}{equals}{rng.choice(others).partition('=')[2]}", f"{rng.choice(others).partition('=')[0]}={value}",
            f"{key}= {rng.choice(WORDS)}", f"[{rng.choice(TABLES)}]", f"{lines[at]}\n{rng.choice(others)}",
            nonsense(rng, lines[at]),
        ])  # fmt: skip
    return "\n".join(lines)


def fuzz_study(rng: random.Random, folder: Path, texts: Sequence[str] = ()) -> str:
    """What came of reading a study of nonsense: "read" or "refused". Anything but a SweepError goes through.

    Parameters
    ----------
    texts : sequence of str
        Of studies that are varied; none: `STUDY` with pieces of nonsense.
    """
    path = folder / "fuzz.toml"
    path.write_text(varied(rng, texts) if texts else nonsense(rng, STUDY), encoding="utf-8", errors="replace")
    try:
        # foreign code would not be run: only our own modules can be loaded at all, and those only where it is allowed
        found = as_study(path, allow_import=rng.random() < 0.9)
        fingerprint(found)
        assert type(found).from_json(found.to_json(), allow_import=True) == found
    except SweepError:
        return "refused"
    again = as_study(tomllib.loads(to_toml(found)), allow_import=True)
    assert fingerprint(again) == fingerprint(found)
    return "read"


def fuzz_plan(rng: random.Random, folder: Path, texts: Sequence[str]) -> int:
    """Exit status of `sweep plan` of a study that was varied and can still be read."""
    while fuzz_study(rng, folder, texts) != "read":
        pass
    return quietly("plan", folder / "fuzz.toml", "--workers", "1", "--allow-import")


def prepared(folder: Path) -> Path:
    """A finished result to be damaged."""
    path = folder / "whole.h5"
    run(study(300), path, workers=1, block_cells=100, progress=False).close()
    return path


def fuzz_result(rng: random.Random, whole: Path, folder: Path) -> list[int]:
    """Exit statuses of commands that are given a damaged result."""
    path = folder / "damaged.h5"
    shutil.copy(whole, path)
    for _ in range(rng.choice([1, 1, 4])):
        flip(rng, path)
    if rng.random() < 0.1:
        path.write_bytes(path.read_bytes()[: rng.randrange(path.stat().st_size)])
    return [
        quietly("show", path),
        quietly("verify", path),
        quietly("fit", path, "--y", "fall_time", "--x", "height"),
        quietly("export", path, "-o", folder / "damaged.csv", "--force"),
    ]


def quietly(*argv: object) -> int:
    """Exit status of a command."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        return main([str(word) for word in argv])
