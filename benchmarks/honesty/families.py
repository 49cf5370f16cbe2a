"""Is a scene of one's own that says OK right, over twenty-seven families of scenes that mislead integrators?

Prints, by family and method, how many cells were OK, remarked and refused, and the largest error of an OK cell over its
rtol, and how many OK cells there are of those that can be solved; exit status 1 where one is off by more than its rtol:

nice python benchmarks/honesty/families.py [FAMILY ...] [--cells 200] [--seed 1] [--methods taylor dop853]

`auto` takes, as a study does, the first method that does not give the cell up. The families stand in smooth_families.py
and families_with_kinks.py. Each also gives the condition of each cell: by how much a relative change of 1 of its
parameters changes its results, roughly. A cell can be solved where 1e-15 times that is below a tenth of its rtol.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "tests" / "helpers"))
import families_with_kinks  # noqa: F401  they enter themselves
import smooth_families  # noqa: F401
from columns import solve
from family import FAMILIES, judged

from kernels.interface import FIRST_REFUSAL, Status

DOUBTED = (Status.INACCURATE, Status.GRAZING)
GIVEN_UP = (Status.NOT_CONVERGED, Status.STEP_LIMIT, Status.NO_METHOD, Status.OUT_OF_RANGE, *DOUBTED)
"""After which `auto` goes on, as in `sweep.cells.solve`."""


def by_auto(found):
    """The outputs and status of the first method that does not give a cell up; else the best that there is."""
    names = [name for name in found if name != "taylor_once"]
    outputs, status = ({k: v.copy() for k, v in found[names[0]][0].items()}, found[names[0]][1].copy())
    for name in names[1:]:
        takes = np.isin(status, GIVEN_UP)
        better = takes & (~np.isin(status, DOUBTED) | (found[name][1] < Status.INACCURATE))
        for key in outputs:
            outputs[key][better] = found[name][0][key][better]
        status[better] = found[name][1][better]
    return outputs, status


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("families", nargs="*", metavar="FAMILY")
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--methods", nargs="*")
    parser.add_argument("--worst", type=int, default=0, help="print so many of the worst cells")
    options = parser.parse_args()
    wrong = 0
    words = "OK", "remark", "refused", "worst/rtol", "wrong", "of solvable"
    print(f"{'family':22}{'method':10}" + "".join(f"{word:>12}" for word in words))
    for name, (kernel, draw, truth_of) in FAMILIES.items():
        if options.families and name not in options.families:
            continue
        random = np.random.default_rng([options.seed, len(name)])
        cells = draw(random, options.cells)
        rtol = cells.pop("rtol", 10.0 ** random.uniform(-12, -3, options.cells))
        with np.errstate(all="ignore"):
            truth = truth_of(**cells)
        methods = options.methods or ["taylor", "rodas5p", "dop853", "dopri5"]
        cells.setdefault("flips", np.ones(options.cells))
        found, started = {}, time.process_time()
        for method in methods:
            found[method] = solve(kernel, method, rtol=rtol, **cells)
        found["auto"] = by_auto(found)
        solvable = np.asarray((truth.condition * 1e-15 < rtol / 10) & ~np.isnan(truth.time), bool)
        for method, (outputs, status) in found.items():
            off = judged(kernel, truth, outputs, status, rtol)
            good = np.isin(status, (Status.OK, Status.COMES_TO_REST))
            refused = status >= FIRST_REFUSAL
            share = (good & solvable).sum() / max(solvable.sum(), 1)
            wrong += int((off > 1).sum())
            print(
                f"{name:22}{method:10}{good.sum():12}{(~good & ~refused).sum():12}{refused.sum():12}{off.max():12.3g}"
                f"{(off > 1).sum():12}{share:12.0%} of {solvable.sum()}", flush=True,
            )  # fmt: skip
            for i in np.argsort(-off)[: options.worst]:
                if off[i] > 1:
                    cell, given = ({k: float(v[i]) for k, v in columns.items()} for columns in (cells, outputs))
                    true = [float(truth.time[i]), *(float(s[i]) for s in truth.states)]
                    print(f"    {cell} rtol {rtol[i]:.3g}: off by {off[i]:.3g} rtol, {given} for {true}")
        counts = zip(*np.unique(found["auto"][1], return_counts=True), strict=True)
        words = ", ".join(f"{Status(status).name} {count}" for status, count in counts)
        print(f"{'':22}{time.process_time() - started:.0f} s; auto: {words}", flush=True)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
