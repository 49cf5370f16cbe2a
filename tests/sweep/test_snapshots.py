"""What each command prints: help, a good run, a mistake, with exit statuses, in `tests/snapshots/COMMAND.txt`.

`python tests/sweep/test_snapshots.py` writes those files anew; read in `git diff` what users will read.
"""

import contextlib
import io
import os
import re
import shutil
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from sweep import cli

SNAPSHOTS = Path(__file__).parents[1] / "snapshots"
STUDY = """# How fast does a stone fall?
title = "Falling stones"
kernel = "toy:KERNEL"
outputs = {outputs}
axes.height = {{ spacing = "log", start = 1, stop = 1000, num = 9 }}
axes.v0 = {{ values = {speeds} }}
"""
ALLOWED = "--allow-import"
OWN = f"{ALLOWED} --no-isolate"
FIT = "fit stones.h5 --x height --y fall_time"
LINES = {
    "sweep": ["--help", "", "rum"],
    "kernels": ["kernels", "kernels toy:KERNEL --allow-import", "kernels folio"],
    "studies": ["studies", "studies verge"],
    "plan": [f"plan stones.toml {OWN}", "plan broken.toml --allow-import"],
    "run": [
        f"run thrown.toml -o new.h5 {OWN}",
        f"run thrown.toml {OWN}",
        f"run stones.toml -o thrown.h5 {OWN}",
        "run stone.toml",
        "run stones.toml",
    ],
    "refine": [f"refine stones.h5 --y fall_time --tolerance {share} -o fine.h5 {OWN}" for share in (0.1, 2)],
    "chart": [
        f"chart stones.toml --cells 4 --rtol 1e-3 {OWN}",
        f"chart stones.toml -o other.png --methods exakt {OWN}",
    ],
    "show": ["show thrown.h5", "show thrown.toml"],
    "cell": [f"cell stones.h5 height=1 v0=1 {ALLOWED}", f"cell stones.h5 height=1 {ALLOWED}", "cell stones.h5 hight=1"],
    "check": [
        f"check thrown.h5 {ALLOWED}",
        f"check thrown.h5 --sample 3 --json {ALLOWED}",
        f"check damaged.h5 {ALLOWED}",
        f"check stones.h5 --sample 0 {ALLOWED}",
    ],
    "verify": ["verify thrown.h5", "verify damaged.h5"],
    "list": ["list", "list --all", "list nowhere"],
    "diff": ["diff stones.h5 stones.h5", "diff stones.h5 damaged.h5", "diff stones.h5 no.h5"],
    "fit": [f"{FIT} --at v0=1", f"{FIT} --at v0=0.4"],
    "exponent": ["exponent stones.h5 --x height --at v0=0", "exponent stones.h5 --x hight"],
    "sensitivity": ["sensitivity stones.h5"],
    "plot": ["plot stones.h5", "plot stones.h5", "plot stones.h5 --y fal_time --force"],
    "view": ["view no.h5"],  # the page itself is looked at in view/test_browser.py
    "report": ["report thrown.h5", "report stones.h5 -o stones.toml"],
    "export": ["export thrown.h5 -o thrown.csv --where v0>0", "export thrown.h5 -o thrown.doc"],
    "join": ["join stones.h5 thrown.h5 -o all.h5", "join stones.h5 stones.h5 -o twice.h5"],
    "completion": ["completion fish"],
}
VOLATILE = {
    r"\d{4}-\d\d-\d\dT[\d:]+(\+[\d:]+)?": "DATE",
    r"\b[\d.,e+-]+ (ns|us|ms|s|min)\b": "TIME",
    r"\b[\d.,e+-]+ (B|kB|bytes)\b": "SIZE",
    r"\d+ cores": "CORES",
    r"[\d,.]+ cells/s": "SPEED",
    r"(?<=versions  )foliot .*(\n {12}.*)*": "...",
    r"(?<=(disk  |blocks)    ).*(\n {12}.*)*": "...",
    r"\d+ %(?=.* of a sample)": "SHARE",  # of as many cells as the machine tries in time
    r"(?<=a sample of )\d+|(?<=on )\d+(?= cells)|(?<=tried\n {12}on )\d+": "N",
    r"(?<=\n  scaling   ).*(\n {12}.*)*": "...",  # looked for as long as the run is forecast to take allows
    r"between its cells (?s:.*)(?=\n)": "...",  # of a block, which is as large as the machine is fast
    r"\d+\.\d+\.\d+": "VERSION",
    r"-o (\S+), --output ": "-o, --output ",  # as Python 3.13 writes it
}


def prepare():
    """Studies and results in the current folder, for all commands alike; in one result a number is another."""
    Path("stones.toml").write_text(STUDY.format(speeds="[0.0, 1.0]", outputs='["fall_time"]'))
    Path("thrown.toml").write_text(STUDY.format(speeds="[2.0, -1.0]", outputs='["fall_time", "impact_speed"]'))
    Path("broken.toml").write_text('kernel = "toy:KERNEL"\nrtol = 2\naxes.heigth.values = [1.0]\n')
    for name in ("stones", "thrown"):
        said(f"run {name}.toml {OWN}")
    content = Path("thrown.h5").read_bytes()
    speed = np.hypot(2.0, np.sqrt(2 * 9.80665 * 1000.0))
    Path("damaged.h5").write_bytes(content.replace(speed.tobytes(), (speed + 1.0).tobytes()))


def said(line):
    """A command line, what it prints, on a mistake also what it complains of, and its exit status."""
    printed, complained = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(complained):
        try:
            status = cli.main(line.split())
        except SystemExit as ended:
            status = ended.code
    text = printed.getvalue() + (complained.getvalue() if status else "")
    return f"$ sweep {line}\n{masked(text)}[{status}]\n"


def masked(text):
    """Without what differs between two runs, machines or versions."""
    text = text.replace(f"{Path.cwd()}/", "")
    for pattern, constant in VOLATILE.items():
        text = re.sub(pattern, constant, text)
    return text


def snapshot(name):
    """All that a command says, in the current folder."""
    return "\n".join(map(said, LINES[name] if name == "sweep" else [f"{name} --help", *LINES[name]]))


def words(text):
    """What is compared: versions of Python wrap and quote in different ways."""
    return text.replace("'", "").split()


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("snapshots")
    with contextlib.chdir(folder):
        prepare()
    return folder


@pytest.mark.parametrize("name", LINES)
def test_what_a_command_prints(prepared, tmp_path, name):
    shutil.copytree(prepared, tmp_path, dirs_exist_ok=True)
    with contextlib.chdir(tmp_path), patch.dict(os.environ, COLUMNS="80", NO_COLOR="1"):
        found = snapshot(name)
    assert not [row for row in found.splitlines() if len(row) > 80 and not row.startswith("$") and "VERSION" not in row]
    assert words(found) == words((SNAPSHOTS / f"{name}.txt").read_text(encoding="utf-8"))


def test_every_command_has_its_snapshot():
    assert set(LINES) == {"sweep", *cli.COMMANDS} == {path.stem for path in SNAPSHOTS.iterdir()}


if __name__ == "__main__":
    import tempfile

    sys.path.append(str(Path(__file__).parents[1] / "helpers"))
    os.environ.update(COLUMNS="80", NO_COLOR="1")
    with tempfile.TemporaryDirectory() as first, contextlib.chdir(first):
        prepare()
        for name in LINES:
            with tempfile.TemporaryDirectory() as folder:
                shutil.copytree(first, folder, dirs_exist_ok=True)
                with contextlib.chdir(folder):
                    (SNAPSHOTS / f"{name}.txt").write_text(snapshot(name), encoding="utf-8")
