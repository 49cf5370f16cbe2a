"""Conditions on the cells of a study: those outside are neither computed nor refused."""

from dataclasses import replace

import numpy as np
import pytest
from toy_studies import build, message_of

import sweep
from kernels.interface import Status

WHERE = "v0**2 < g*height"
AXES = {"height": [-1.0, 1.0, 2.0, 4.0], "v0": [0.0, 1.0, 3.0]}


def test_a_condition_that_holds_nowhere_is_told_before_anything_is_run(tmp_path):
    study = build(axes=AXES, where="height > 4")
    for function, *path in ((sweep.run,), (sweep.run, tmp_path / "a.h5"), (sweep.plan,)):
        with pytest.raises(sweep.SweepError, match='where = "height > 4": holds for none of the 12 cells'):
            function(study, *path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("where", "holds"),
    [
        ("height > 1", lambda h, v: h > 1),
        ("not height > 1 or v0 == 3", lambda h, v: ~(h > 1) | (v == 3)),
        ("height > '150 cm'", lambda h, v: h > 1.5),
        ("'1 km/hour' < v0", lambda h, v: v > 1000 / 3600),
        ("v0**2 < 2*g*height", lambda h, v: v**2 < 2 * 9.81 * h),
        ("v0**2/(g*height) < 0.1", lambda h, v: v**2 / (9.81 * h) < 0.1),
        ("method == 'exact' or height > 1", lambda h, v: h > 1),
    ],
)
def test_what_a_condition_says(where, holds):
    axes = AXES | ({"method": ["auto"]} if "method" in where else {})
    found = sweep.run(build(axes=axes, where=where)).status.values.reshape(4, 3)
    height, v0 = np.array(AXES["height"])[:, None], np.array(AXES["v0"])[None, :]
    assert np.array_equal(found != Status.NOT_ASKED, np.broadcast_to(holds(height, v0), (4, 3)))


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("height < v0", "height is in meter and v0 is in meter / second; they cannot be compared"),
        ("height + v0 < 3", "they cannot be compared"),
        ("height < '3 kg'", '"kg" is a mass; height is a length'),
        ("2*height < '3 m'", "compare it with a parameter alone"),
        ("hight > 1", "did you mean height?"),
        ("height", "is no condition on the cells"),
        ("height >", "cannot be read"),
        ("1 < 2", "compares two constants"),
        ("__import__('os').system('true') == 0", "is not allowed"),
        ("height**0.5 > 1", "a power is a whole number from 1 to 9"),
        ("fall_time > 1", "no parameter of one number is called fall_time"),
        ("method == 'exact'", "no parameter of one number is called method"),
        ("height > 'tall'", "compares words with numbers"),
    ],
)
def test_what_is_wrong_with_a_condition_is_told(where, message):
    assert message in message_of(lambda: build(axes=AXES, where=where), "where")


def test_words_of_a_method_axis_may_be_asked_for():
    axes = {"height": [1.0, 2.0], "method": ["rough", "exact"]}
    found = sweep.run(build(axes=axes, where="method == 'exact' or height < 2"))
    assert (found.status.values == Status.NOT_ASKED).tolist() == [[False, False], [True, False]]
    assert 'method is never "exakt"' in message_of(lambda: build(axes=axes, where="method == 'exakt'"), "where")


def test_a_kernel_may_not_say_it():
    study = build(axes={"height": [1.0]}, method="exact")

    def check(height, v0, g, status):
        status[...] = Status.NOT_ASKED

    found = sweep.run(replace(study, kernel=replace(study.kernel, check=check)))
    assert found.status.values.tolist() == [Status.FAILED]


def test_a_study_with_a_condition_is_extended(tmp_path):
    first = build(axes={"height": [1.0, 2.0, 4.0]}, where="height > 1.5")
    sweep.run(first, tmp_path / "a.h5").close()
    more = build(axes={"height": [1.0, 1.2, 2.0, 3.0, 4.0]}, where="height > 1.5")
    found = sweep.run(more, tmp_path / "a.h5", extend=True).load()
    assert found.status.values.tolist() == [Status.NOT_ASKED, Status.NOT_ASKED, 0, 0, 0]
    other = build(axes={"height": [1.0, 1.2, 2.0, 3.0, 4.0, 5.0]}, where="height > 1.7")
    with pytest.raises(sweep.SweepError, match="where"):
        sweep.run(other, tmp_path / "a.h5", extend=True)
