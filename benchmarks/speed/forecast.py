"""How far is what `sweep plan` forecasts from what a run then takes, in time and bytes?

    python benchmarks/speed/forecast.py [FOLDER] [--times 5]

Forecast and run in turn, so that both meet the same load: the README's study (1401 cells, where what any run costs
decides), a dear kernel (the foliot's `segments`, 2e6 cells) and a cheap one (`closed`, 1e7 cells, where the disk does).
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

import sweep
from sweep.study.model import Study

README = Path(__file__).parents[2] / "studies" / "foliot_scaling.toml"


def studies() -> dict[str, Study]:
    """What is forecast."""
    springs = {"mu": np.geomspace(0.5, 1e3, 10_000), "R": np.linspace(0.0, 0.4, 200)}
    drives = {"mu": np.geomspace(1e-4, 1e6, 10_000), "a": np.geomspace(0.1, 10.0, 1000)}
    segments = sweep.build_study(
        kernel="foliot", method="segments", axes=springs, fixed={"a": 1.0, "phi0": 1.0, "k": 0.3}
    )
    closed = sweep.build_study(kernel="foliot", method="closed", outputs=["period"], axes=drives, fixed={"phi0": 1.0})
    return {"README": sweep.read_study(README), "segments": segments, "closed": closed}


def compared(name: str, study: Study, path: Path) -> float:
    """Relative error of the forecast of time; prints a line."""
    plan = sweep.plan(study, path=path)
    begun = time.perf_counter()
    sweep.run(study, path, progress=False).close()
    seconds, size = time.perf_counter() - begun, path.stat().st_size
    path.unlink()
    found = plan.seconds / seconds - 1
    print(
        f"{name}: forecast {plan.seconds:.2f} s, run {seconds:.2f} s ({found:+.0%}); "
        f"bytes {plan.output_bytes / size - 1:+.1%}",
        flush=True,
    )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path())
    parser.add_argument("--times", type=int, default=5)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.folder) as folder:
        for name, study in studies().items():
            errors = [abs(compared(name, study, Path(folder) / "out.h5")) for _ in range(given.times)]
            print(f"{name}: median of the forecasts' errors {np.median(errors):.0%}, largest {max(errors):.0%}")


if __name__ == "__main__":
    main()
