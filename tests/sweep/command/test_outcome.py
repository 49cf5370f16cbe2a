"""How a fault is told: its exit status and one text."""

import pytest

from sweep.command.outcome import explained
from sweep.system.errors import SweepError


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (SweepError("so"), 2, "so"),
        (KeyboardInterrupt(), 130, "stopped"),
        (SystemExit(143), 143, "stopped"),
        (SystemExit(), 1, "stopped"),
        (SystemExit("words"), 1, "stopped"),
        (MemoryError(), 2, "out of memory; choose fewer cells, fewer outputs or fewer workers"),
        (OSError(28, "No space left on device", "/x"), 2, "/x: No space left on device"),
        (OSError(28, "No space left on device"), 2, "the system: No space left on device"),
        (OSError("odd"), 2, "the system: odd"),
    ],
)
def test_a_fault_has_its_status_and_its_words(error, code, text):
    assert explained(error) == (code, text)


def test_a_fault_of_ours_asks_to_be_reported():
    found = explained(KeyError("x"))
    assert found.code == 1
    assert found.text.splitlines() == [
        "a fault in foliot: KeyError: 'x'",
        "Please report it; with SWEEP_TRACEBACK=1 in the environment the same command says where.",
    ]
