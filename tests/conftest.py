"""Hypothesis profiles, and the toy kernel as an importable module `toy`."""

import os
import sys
from pathlib import Path

from hypothesis import settings

settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

sys.path.insert(0, str(Path(__file__).parent / "sweep"))
