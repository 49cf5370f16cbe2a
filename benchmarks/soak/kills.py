"""How many acknowledged blocks are lost when runs are killed at random moments, and how many runs end with other bits?

    python benchmarks/soak/kills.py [--kills 1000] [--seed 1]

Kills (SIGKILL) strike plain runs, extensions, refinements and summaries on 1, 2 and 8 threads with blocks of 30 to 3000
cells at any moment, also while the result is renamed; each run is continued until it ends. Prints the figures; exit
status 1 where one of them is not 0.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / "tests" / "helpers")]

from havoc import Victims, torture  # noqa: E402

SHAPES = (30, 100, 400, 3000)


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--kills", type=int, default=1000)
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as name, Victims() as victims:
        folder = Path(name)
        found = torture(random.Random(given.seed), victims, folder, given.kills, SHAPES)
    print(f"  killed: {', '.join(f'{stage} {count}' for stage, count in found['stages'].most_common())}")
    print(
        f"{found['kills']} kills of {found['runs']} runs that were continued to their end; of {found['acknowledged']} "
        f"blocks acknowledged by killed runs lost: {found['lost']}; runs that ended with other bits, or left something "
        f"behind: {found['different']}"
    )
    return int(found["lost"] > 0 or found["different"] > 0)


if __name__ == "__main__":
    sys.exit(main())
