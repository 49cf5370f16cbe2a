"""Hypothesis profiles; the helpers of the tests (`oracles`, `columns`, `toy`, `havoc`), studies and docs as modules."""

import gc
import os
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

AT_ANY_LOAD = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("local", **AT_ANY_LOAD)
settings.register_profile("ci", derandomize=True, print_blob=True, **AT_ANY_LOAD)
settings.load_profile("ci" if os.environ.get("CI") else "local")

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""One thread a worker: where all cores are busy, those of OpenBLAS wait for each other."""

TESTS = Path(__file__).parent
PLACES = ("tests/oracles", "tests/helpers", "benchmarks/soak", "studies", "docs")
sys.path += [str(TESTS.parent / place) for place in PLACES]

gc.disable()  # until all tests are read, a fifth of whose time it takes

# a shell ignores Ctrl-C for what it runs in the background, and children inherit that; here it is under test
signal.signal(signal.SIGINT, signal.default_int_handler)


def listed(name):
    """Files, and tests of files, that a list beside this file names, in its order."""
    lines = (TESTS / name).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line.startswith("tests/")]


QUICK = set(listed("quick.txt"))
"""What `pytest -m quick` runs."""
LONG = {file: place for place, file in enumerate(listed("long.txt"))}
"""What workers begin with, so that none of them is left alone with it in the end."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """Two more than cores: some tests wait for processes, for clocks, or for what another worker compiles."""
    return (os.cpu_count() or 1) + 2


APART = ("tests/studies/test_claims.py", "tests/kernels/test_contract.py")
"""Files that are longer than a worker's share: dealt out by the study or kernel in brackets."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid):
            file, _, which = nodeid.partition("::")[0], *nodeid.partition("[")[1:]
            return f"{file}[{which}" if file in APART else file

    return Scheduling(config, log) if config.getvalue("dist") == "loadfile" else None


def pytest_configure(config):
    config.option.loadscopereorder = False  # xdist would take files with many tests first, not those that take long


def pytest_ignore_collect(collection_path, config):
    """Of `-m quick` alone, files without a quick test are not even read: that takes ten seconds."""
    path = f"tests/{collection_path.relative_to(TESTS).as_posix()}"
    unread = config.option.markexpr == "quick" and path.endswith(".py") and not any(q.startswith(path) for q in QUICK)
    return unread or None


def pytest_collection_finish():
    """What is there by now stays: looking through it for garbage takes a twentieth of the time of tests."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: LONG.get(item.nodeid.partition("::")[0], len(LONG)))
    for item in items:
        file, _, test = item.nodeid.partition("::")
        if file in QUICK or f"{file}::{test.partition('[')[0]}" in QUICK:
            item.add_marker("quick")
