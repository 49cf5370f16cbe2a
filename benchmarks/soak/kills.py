"""How many acknowledged blocks are lost when runs are killed at random moments, and how many runs end with other bits?

    python benchmarks/soak/kills.py [FOLDER] [--kills 2000] [--cluster 200] [--seed 1]

Kills (SIGKILL) strike plain runs, extensions, refinements and summaries on 1, 2 and 8 threads, and clients of a
cluster, with blocks of 30 to 3000 cells: before the frame of the file, at work, at the end, while it is renamed. Each
run is continued until it ends, after eight kills at most. Prints which phase of which run was hit, as the
run itself had noted it, and the figures; exit status 1 where one of them is not 0. Workers of a cluster are killed by
`cluster.py`.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / "tests" / "helpers")]

from clusters import served  # noqa: E402
from killing import KINDS, PHASES, Torture, Victims  # noqa: E402

SHAPES = (30, 100, 400, 3000)


def main() -> int:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("folder", nargs="?", type=Path, help="in which files are written; default: the system's")
    arguments.add_argument("--kills", type=int, default=2000, help="of runs here")
    arguments.add_argument("--cluster", type=int, default=200, help="of clients of a cluster")
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    rng, begun = random.Random(given.seed), time.monotonic()
    with (
        tempfile.TemporaryDirectory(dir=given.folder) as name,
        served(workers=2, failures=10) as (address, _),
        Victims(address) as victims,
    ):
        found = Torture(rng, victims, Path(name), SHAPES)
        while found.kills < given.kills:
            found.kill(KINDS[found.runs % len(KINDS)], 1)
        found.kill("cluster", given.cluster)
    _told(found)
    print(f"{time.monotonic() - begun:.0f} s")
    return int(found.lost > 0 or found.different > 0)


def _told(found: Torture) -> None:
    kinds = list(dict.fromkeys(kind for kind, _ in found.hits))
    print(f"{'killed':18}" + "".join(f"{kind:>10}" for kind in kinds))
    for phase in sorted({phase for _, phase in found.hits}):
        print(f"{PHASES[phase]:18}" + "".join(f"{found.hits[kind, phase]:10}" for kind in kinds))
    print(
        f"{found.kills} kills in {found.runs} runs that were continued to their end; of {found.acknowledged} blocks "
        f"acknowledged by killed runs lost: {found.lost}; runs that ended with other bits, or left something behind: "
        f"{found.different}"
    )


if __name__ == "__main__":
    sys.exit(main())
