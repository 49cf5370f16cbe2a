"""Does any command fall over, hang, take much memory or read other files, given a result that somebody has forged?

    python benchmarks/soak/forged.py [--results 300] [--minutes 30] [--seed 1] [--only show ...]

Attributes, types, shapes, chunks, filters, links, object headers, numbers and the layout are forged, and sealed anew
in most cases. Every command that reads results must end with a message, or do what it is for, within 20 s of a
processor and 1 GB.
Prints the figures; exit status 1 where one does not.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / "tests" / "helpers")]

from forging import became, commands, forged, import_all, prepared, wrong  # noqa: E402

from sweep.store.probe import probing  # noqa: E402

ALWAYS = {"show", "verify"}
"""Commands that every result is given; of the others some."""


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--results", type=int, default=300)
    arguments.add_argument("--minutes", type=float, default=math.inf, help="begin no result after so many")
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--first", type=int, default=0, help="number of the first result, to see one again")
    arguments.add_argument("--only", nargs="*", default=[], help="commands")
    given = arguments.parse_args()
    import_all()
    ends, bad, slowest, largest = Counter(), [], (0.0, ""), (0, "")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        whole, log = prepared(folder), folder / "log"
        scratch = folder / "scratch"
        scratch.mkdir()
        (scratch / "study.toml").write_text((folder / "study.toml").read_text())
        os.mkfifo(scratch / "secret")  # who opens it waits for ever
        stop, number = time.monotonic() + 60.0 * given.minutes, given.first
        for number in range(given.first, given.first + given.results):
            if time.monotonic() > stop:
                break
            path = scratch / "out.h5"
            kind = forged(random.Random(given.seed * 10**9 + number), whole, path)
            content = path.read_bytes()
            all_commands = commands(path, whole)
            others = random.Random(number).sample(sorted(all_commands.keys() - ALWAYS), 3)
            chosen = given.only or sorted([*ALWAYS, *others], key=lambda title: title.startswith("run"))
            probing(path)()  # once for all commands; what cannot be read each of them finds out again
            for title in chosen:
                words = all_commands[title]
                if path.read_bytes() != content:
                    path.write_bytes(content)
                end = became(words, log)
                ends[f"{title}: {end.code}"] += 1
                slowest, largest = max(slowest, (end.seconds, title)), max(largest, (end.memory, title))
                if what := wrong(words, end):
                    bad.append(f"{number}, {kind}, {title}: {what}")
                    print(bad[-1], flush=True)
                for left in scratch.glob("out.h5.*"):
                    left.unlink()
    print("\n".join(f"  {end}: {count}" for end, count in sorted(ends.items())))
    print(f"  slowest {slowest[0]:.1f} s ({slowest[1]}), largest {largest[0] >> 20} MB ({largest[1]})")
    print(f"results {given.first} to {number}, {sum(ends.values())} commands; wrong: {len(bad)}")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
