"""Studies of the toy kernels, for tests."""

import pytest

import sweep

HEAD = 'kernel = "toy:KERNEL"\noutputs = ["fall_time"]\n'
"""Beginning of a study file."""
STONES = """
title = "Stones"
kernel = "{kernel}"
outputs = ["fall_time"]
[axes.height]
spacing = "linear"
start = 1
stop = {count}
num = {count}
"""
"""A study file of stones of 1, 2, 3 ... m."""


def build(**keys):
    """A study of the toy, which gives its fall time unless the keys say more."""
    return sweep.study(**{"kernel": "toy:KERNEL", "allow_import": True, "outputs": ["fall_time"], **keys})


def build_rich(**keys):
    """A study of the rich kernel over two loads, unless the keys say more."""
    return sweep.study(**{"kernel": "toy:RICH", "allow_import": True, "axes": {"load": [1.0, 2.0]}, **keys})


def message_of(action, where):
    """What is said of `where` in the StudyError that `action` raises."""
    with pytest.raises(sweep.StudyError) as caught:
        action()
    return {m.where: m.message for m in caught.value.mistakes}[where]
