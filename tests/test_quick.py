"""The quick choice of tests names tests that are there."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "tests" / "quick.txt").read_text(encoding="utf-8")
LINES = [line for line in TEXT.splitlines() if line.startswith("tests/")]


@pytest.mark.parametrize("line", LINES)
def test_a_quick_test_is_there(line):
    file, _, test = line.partition("::")
    text = (ROOT / file).read_text(encoding="utf-8")
    assert f"def {test or 'test_'}" in text


def test_every_room_has_a_quick_test():
    rooms = {path.parent.relative_to(ROOT / "tests") for path in (ROOT / "tests").glob("*/*/test_*.py")}
    chosen = {Path(line.partition("::")[0]).parent.relative_to("tests") for line in LINES}
    assert {str(room) for room in rooms - chosen} <= {"studies"}
