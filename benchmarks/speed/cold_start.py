"""What a first run costs: processor seconds of a kernel's small study, without compiled code and with it.

    python benchmarks/speed/cold_start.py [KERNEL ...]

Each is a process of its own, `sweep run` of the study that `sweep kernels KERNEL --study` writes, on one thread; the
folder of compiled code is empty before the first of two runs.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from kernels.catalogue import KERNELS
from sweep.show.kernels import write_starter

ROOT = Path(__file__).parents[2]
WANTED = 6.0
"""Seconds that no first run should exceed."""


def processor_seconds(study: Path, output: Path, cache: Path) -> float:
    """User and system time of a run."""
    command = [sys.executable, "-m", "sweep", "run", study, "-o", output, "--workers", "1"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    env = {**os.environ, "XDG_CACHE_HOME": str(cache), "NUMBA_CACHE_DIR": "", "PYTHONPATH": str(ROOT)}
    subprocess.run(command, env=env, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def cold_and_warm(kernel: str) -> tuple[float, float]:
    """Seconds of a first and of a second run."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        study = folder / "study.toml"
        write_starter(kernel, study)
        cold, warm = (processor_seconds(study, folder / f"{run}.h5", folder / "cache") for run in ("cold", "warm"))
    return cold, warm


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("kernels", nargs="*", metavar="KERNEL", help=f"of {', '.join(KERNELS)}; default: all")
    kernels = parser.parse_args().kernels or KERNELS
    if unknown := [kernel for kernel in kernels if kernel not in KERNELS]:
        parser.error(f"no such kernel: {', '.join(unknown)}")
    print(f"{'kernel':20}{'cold':>8}{'warm':>8}  processor seconds")
    for kernel in kernels:
        cold, warm = cold_and_warm(kernel)
        print(
            f"{kernel:20}{cold:8.1f}{warm:8.1f}{'  above ' + format(WANTED, 'g') if cold > WANTED else ''}", flush=True
        )


if __name__ == "__main__":
    main()
