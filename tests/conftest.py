"""Hypothesis profiles; the helpers of the tests (`oracles`, `columns`, `toy`), studies and docs as modules."""

import os
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

TESTS = Path(__file__).parent
sys.path += [str(TESTS / "oracles"), str(TESTS / "helpers"), str(TESTS.parent / "studies"), str(TESTS.parent / "docs")]

# a shell ignores Ctrl-C for what it runs in the background, and children inherit that; here it is under test
signal.signal(signal.SIGINT, signal.default_int_handler)

QUICK = {line for line in (TESTS / "quick.txt").read_text(encoding="utf-8").splitlines() if line.startswith("tests/")}
"""Files, and tests of files, that `pytest -m quick` runs."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        file, _, test = item.nodeid.partition("::")
        if file in QUICK or f"{file}::{test.partition('[')[0]}" in QUICK:
            item.add_marker("quick")
