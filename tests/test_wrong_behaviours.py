"""The wrong behaviours that the tests are tried on fit today's sources, so that they can be tried at any time."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_each_wrong_behaviour_can_be_put_into_the_sources():
    command = [sys.executable, "benchmarks/soak/power.py", "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
