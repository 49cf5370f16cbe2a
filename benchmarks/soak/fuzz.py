"""Does any study file or damaged result end in a traceback, or never?

    python benchmarks/soak/fuzz.py [--studies 100000] [--results 300] [--seed 1]

A study of nonsense must be read or refused with a message; `sweep show`, `verify`, `fit`, `export` of a result with
flipped bits, half of them sealed anew, must end with exit status 0 or 2. Prints the figures; exit status 1 where
anything else happens.
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

from fuzzing import fuzz_result, fuzz_study, prepared  # noqa: E402


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--studies", type=int, default=100_000)
    arguments.add_argument("--results", type=int, default=300)
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    found, slowest, wrong = Counter(), {"study": 0.0, "result": 0.0}, []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        whole = prepared(folder)
        for number in range(given.studies + given.results):
            kind = "study" if number < given.studies else "result"
            rng, begun = random.Random(given.seed * 10**9 + number), time.monotonic()
            try:
                came = fuzz_study(rng, folder) if kind == "study" else str(fuzz_result(rng, whole, folder))
                if kind == "result" and set(came) & set("1346789"):
                    wrong.append(f"{kind} {number}: exit statuses {came}")
            except Exception as fault:
                came = "traceback"
                wrong.append(f"{kind} {number}: {type(fault).__name__}: {str(fault)[:100]}")
            found[f"{kind}: {came}"] += 1
            slowest[kind] = max(slowest[kind], time.monotonic() - begun)
    print("\n".join(f"  {came}: {count}" for came, count in found.most_common()))
    print(f"  slowest study {slowest['study']:.1f} s, slowest result (four commands) {slowest['result']:.1f} s")
    print("\n".join(wrong[:20]))
    print(f"{given.studies} studies, {given.results} results; tracebacks and faults: {len(wrong)}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
