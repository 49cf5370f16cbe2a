"""Does any study file or damaged result end in a traceback, or never?

    python benchmarks/soak/fuzz.py [--studies 100000] [--shipped 10000] [--plans 300] [--results 300] [--seed 1]

A study of nonsense, and one that comes with foliot and was changed here and there, must be read or refused with a
message, and some are planned; `sweep show`, `verify`, `fit`, `export` of a result with
flipped bits, half of them sealed anew, must end with exit status 0 or 2. Prints the figures; exit status 1 where
anything else happens.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

STUDIES = Path(__file__).parents[2] / "studies"
sys.path[:0] = [str(Path(__file__).parents[2] / "tests" / "helpers")]

from fuzzing import fuzz_plan, fuzz_result, fuzz_study, prepared  # noqa: E402

SECONDS = 60
"""What a study may take, or the commands on a result."""


def tries_in(folder: Path) -> dict[str, Callable[[random.Random], object]]:
    """What is tried, by its name."""
    whole = prepared(folder)
    texts = [path.read_text(encoding="utf-8") for path in sorted(STUDIES.glob("*.toml"))]
    for path in [*STUDIES.glob("*.csv"), *STUDIES.glob("*.py")]:
        shutil.copy(path, folder)
    return {
        "study": lambda rng: fuzz_study(rng, folder),
        "shipped": lambda rng: fuzz_study(rng, folder, texts),
        "plan": lambda rng: fuzz_plan(rng, folder, texts),
        "result": lambda rng: fuzz_result(rng, whole, folder),
    }


def too_long(*rest: object) -> None:
    """Ends what takes too long."""
    raise TimeoutError(f"takes more than {SECONDS} s")


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--studies", type=int, default=100_000)
    arguments.add_argument("--shipped", type=int, default=10_000, help="variants of the studies that come with foliot")
    arguments.add_argument("--plans", type=int, default=300, help="of these that are planned")
    arguments.add_argument("--results", type=int, default=300)
    arguments.add_argument("--seed", type=int, default=1)
    given = arguments.parse_args()
    counts = {"study": given.studies, "shipped": given.shipped, "plan": given.plans, "result": given.results}
    found, slowest, wrong = Counter(), dict.fromkeys(counts, 0.0), []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tries = tries_in(folder)
        signal.signal(signal.SIGALRM, too_long)
        for number, kind in enumerate(kind for kind, count in counts.items() for _ in range(count)):
            rng, begun = random.Random(given.seed * 10**9 + number), time.monotonic()
            signal.alarm(SECONDS)
            try:
                came = str(tries[kind](rng))
                if set(re.findall(r"\d+", came)) - {"0", "2"}:
                    wrong.append(f"{kind} {number}: exit statuses {came}")
            except Exception as fault:
                came = "traceback"
                wrong.append(f"{kind} {number}: {type(fault).__name__}: {str(fault)[:100]}")
                print(wrong[-1], flush=True)
                if kind != "result":
                    wrong[-1] += "\n" + (folder / "fuzz.toml").read_text(encoding="utf-8")
            signal.alarm(0)
            found[f"{kind}: {came}"] += 1
            slowest[kind] = max(slowest[kind], time.monotonic() - begun)
    print("\n".join(f"  {came}: {count}" for came, count in found.most_common()))
    print("  slowest:", ", ".join(f"{kind} {seconds:.1f} s" for kind, seconds in slowest.items()))
    print("\n".join(wrong[:20]))
    print(f"{sum(counts.values())} tries; tracebacks and faults: {len(wrong)}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
