"""How far does a reader walk who follows one study? Modules of `sweep` entered, and changes from one to another.

    python benchmarks/speed/walk.py

Traces one `sweep.run` of 500 cells to a file, in all its threads, after one that has compiled and imported everything.
"""

from __future__ import annotations

import sys
import threading
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

import numpy as np

import sweep

ROOM = str(Path(sweep.__file__).parent) + "/"


class Walk(threading.local):
    """Where a thread is."""

    place = ""


def main() -> None:
    axes = {"mu": np.geomspace(1e-2, 1e2, 50), "a": np.geomspace(0.1, 10.0, 10)}
    study = sweep.study(kernel="foliot", axes=axes, fixed={"phi0": 1.0})
    walk, entered, changes = Walk(), Counter[str](), Counter[tuple[str, str]]()

    def step(frame: FrameType, event: str, _: Any) -> None:
        file = frame.f_code.co_filename
        if event == "call" and file.startswith(ROOM):
            here = file.removeprefix(ROOM)
            entered[here] += 1
            if walk.place not in ("", here):
                changes[walk.place, here] += 1
            walk.place = here

    with TemporaryDirectory() as folder:
        sweep.run(study, Path(folder) / "first.h5", progress=False).close()
        threading.setprofile(step)
        sys.setprofile(step)
        try:
            sweep.run(study, Path(folder) / "walked.h5", progress=False).close()
        finally:
            sys.setprofile(None)
            threading.setprofile(None)
    print(f"{len(entered)} modules entered, {sum(changes.values())} changes of module; the most frequent:")
    for (here, there), count in changes.most_common(12):
        print(f"  {count:4} {here} -> {there}")


if __name__ == "__main__":
    main()
