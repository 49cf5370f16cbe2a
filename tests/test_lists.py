"""Lists name what is there: pinned versions, quick and long tests, wrong behaviours to try, statuses of the page."""

import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from kernels.interface import Status

ROOT = Path(__file__).parent.parent
PINS = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]


def listed(name):
    text = (ROOT / "tests" / name).read_text(encoding="utf-8")
    return [line for line in text.splitlines() if line.startswith("tests/")]


QUICK, LONG = listed("quick.txt"), listed("long.txt")


def test_each_package_is_pinned_once_in_a_line_that_every_pip_understands():
    wanted = [Requirement(line) for line in PINS]
    for one in wanted:
        (pin,) = one.specifier
        assert pin.operator == "=="
        assert Version(pin.version)
    names = [one.name.lower().replace("_", "-") for one in wanted]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("line", QUICK)
def test_a_quick_test_is_there(line):
    file, _, test = line.partition("::")
    assert f"def {test or 'test_'}" in (ROOT / file).read_text(encoding="utf-8")


def test_every_room_has_a_quick_test():
    rooms = {path.parent.relative_to(ROOT / "tests") for path in (ROOT / "tests").glob("*/*/test_*.py")}
    chosen = {Path(line.partition("::")[0]).parent.relative_to("tests") for line in QUICK}
    assert {str(room) for room in rooms - chosen} <= {"studies"}


def test_what_takes_long_is_there_and_begun_first(request):
    assert all((ROOT / file).is_file() for file in LONG)
    assert len(set(LONG)) == len(LONG)
    begun = [file for item in request.session.items if (file := item.nodeid.partition("::")[0]) in LONG]
    assert list(dict.fromkeys(begun)) == [file for file in LONG if file in begun]


def test_each_wrong_behaviour_can_be_put_into_the_sources():
    command = [sys.executable, "benchmarks/soak/power.py", "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_page_of_statuses_has_each_in_the_order_of_its_number():
    lines = (ROOT / "docs" / "statuses.md").read_text(encoding="utf-8").splitlines()
    told = [
        line.split("|")[1].strip() for line in lines if line.startswith("| ") and line.split("|")[1].strip().isupper()
    ]
    by_kind = sorted(Status, key=lambda s: (s >= Status.NOT_ASKED, s.kind == "unsolved", s))
    assert told == [status.name for status in by_kind]
