"""The pinned versions are lines that every pip understands."""

from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

CONSTRAINTS = Path(__file__).parent.parent / "constraints.txt"
LINES = [line for line in CONSTRAINTS.read_text().splitlines() if not line.startswith("#")]


@pytest.mark.parametrize("line", LINES)
def test_a_line_pins_one_version(line):
    wanted = Requirement(line)
    (pin,) = wanted.specifier
    assert pin.operator == "=="
    assert Version(pin.version)


def test_no_package_is_pinned_twice():
    names = [Requirement(line).name.lower().replace("_", "-") for line in LINES]
    assert len(names) == len(set(names))
