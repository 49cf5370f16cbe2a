"""How much of the damage to results, finished or not, is missed, or not repaired?

    python benchmarks/soak/damage.py [--tries 10000] [--flips 2000] [--minutes 15] [--seed 1]

A flipped bit, 512 bytes zeroed, a file cut, emptied, missing or lengthened, chunks that changed places, with their
digests too, or are of another study. Of an unfinished result `sweep verify` must tell, and the continued run must end
with the same bits; a finished one must be found, and repaired where its structure is whole. Then bits of a finished
result are flipped that `sweep`, h5py and xarray with both its engines read: each must refuse it or find what was
written, but for flips in HDF5's global heap, which are for `sweep` alone. Prints the figures, those that count at the
end; exit status 1 where anything is missed.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / "tests" / "helpers")]

from havoc import READERS, damaged_result, damaged_unfinished, misread, numbers, study, unfinished  # noqa: E402

from sweep.runs.run import complete  # noqa: E402


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--tries", type=int, default=10_000)
    arguments.add_argument("--flips", type=int, default=2000, help="bits that are flipped before four readers")
    arguments.add_argument("--minutes", type=float, default=math.inf, help="begin no try after so many")
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    rng, kinds, wrong, slowest = random.Random(given.seed), Counter(), [], 0.0
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "scratch").mkdir()
        for name, keys in (("whole", {}), ("strange", {"fixed": {"g": 1.6}})):
            complete(study(**keys), folder / f"{name}.h5", workers=1, block_cells=300, progress=False)
        strange, bits = (folder / "strange.h5").read_bytes(), numbers(folder / "whole.h5")
        paths = {"unfinished": unfinished(folder / "out.h5"), "finished": folder / "whole.h5"}
        end = time.monotonic() + 60.0 * given.minutes
        for number in range(given.tries):
            begun = time.monotonic()
            if begun > end:
                break
            state = "unfinished" if number % 3 == 0 else "finished"
            damaged = damaged_unfinished if state == "unfinished" else damaged_result
            kind, what = damaged(rng, paths[state], strange, folder / "scratch", bits)
            kinds[f"{state}: {kind}"] += 1
            slowest = max(slowest, time.monotonic() - begun)
            if what:
                wrong.append(f"try {number}, {state}, {kind}: {what}")
                print(wrong[-1], flush=True)
        sound = {name: read(paths["finished"]) for name, read in READERS.items()}
        for number in range(given.flips):
            kind, what = misread(rng, paths["finished"], folder / "scratch", sound)
            kinds[f"flip before readers: {kind}"] += 1
            if what:
                wrong.append(f"flip {number}: {what}")
                print(wrong[-1], flush=True)
    print("\n".join(f"  {kind}: {count}" for kind, count in sorted(kinds.items())))
    print("\n".join(wrong[:20]))
    print(f"{sum(kinds.values())} tries, the slowest {slowest:.1f} s; missed or wrong: {len(wrong)}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
