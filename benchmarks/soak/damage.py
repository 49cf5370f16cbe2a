"""How much of the damage to parts and results is missed?

    python benchmarks/soak/damage.py [--tries 10000] [--seed 1]

One try in ten damages the parts of a sweep (a flipped bit, a file cut, emptied, missing, doubled, swapped, foreign, of
another study; a flipped bit of spec.json): `sweep verify` must name it, and the continued run must end with the same
bits. The others damage a finished result (a flipped bit, 512 bytes zeroed, cut, lengthened): `sweep verify` must find
it. Prints the figures, those that count at the end; exit status 1 where anything is missed.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2] / "tests" / "helpers")]

from havoc import damaged_parts, damaged_result, numbers, run, study, unfinished  # noqa: E402


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--tries", type=int, default=10_000)
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    rng, kinds, wrong, slowest = random.Random(given.seed), Counter(), [], 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scratch").mkdir()
        run(study(), folder / "whole.h5", workers=1, block_cells=300, progress=False).close()
        whole, parts = numbers(folder / "whole.h5"), unfinished(folder / "out.h5")
        for number in range(given.tries):
            begun = time.monotonic()
            of_parts = number % 10 == 0
            kind, what = (
                damaged_parts(rng, parts, folder / "scratch", whole)
                if of_parts
                else damaged_result(rng, folder / "whole.h5", folder / "scratch")
            )
            kinds[f"{'parts' if of_parts else 'result'}: {kind}"] += 1
            slowest = max(slowest, time.monotonic() - begun)
            if what:
                wrong.append(f"try {number}, {kind}: {what}")
    print("\n".join(f"  {kind}: {count}" for kind, count in sorted(kinds.items())))
    print("\n".join(wrong[:20]))
    print(f"{given.tries} tries, the slowest {slowest:.1f} s; missed or wrong: {len(wrong)}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
