"""The quick choice of tests, and the list of those that take long, name tests that are there."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def listed(name):
    text = (ROOT / "tests" / name).read_text(encoding="utf-8")
    return [line for line in text.splitlines() if line.startswith("tests/")]


LINES, LONG = listed("quick.txt"), listed("long.txt")


@pytest.mark.parametrize("line", LINES)
def test_a_quick_test_is_there(line):
    file, _, test = line.partition("::")
    text = (ROOT / file).read_text(encoding="utf-8")
    assert f"def {test or 'test_'}" in text


def test_every_room_has_a_quick_test():
    rooms = {path.parent.relative_to(ROOT / "tests") for path in (ROOT / "tests").glob("*/*/test_*.py")}
    chosen = {Path(line.partition("::")[0]).parent.relative_to("tests") for line in LINES}
    assert {str(room) for room in rooms - chosen} <= {"studies"}


def test_what_takes_long_is_begun_first_and_is_there(request):
    assert all((ROOT / file).is_file() for file in LONG)
    assert len(set(LONG)) == len(LONG)
    begun = [file for item in request.session.items if (file := item.nodeid.partition("::")[0]) in LONG]
    assert list(dict.fromkeys(begun)) == [file for file in LONG if file in begun]
