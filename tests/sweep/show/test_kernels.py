"""What `sweep kernels` prints, word for word, of a kernel that declares one field of every kind."""

import math

import pytest

from kernels.interface import Field, Kernel, Method
from sweep.show import kernels

ARM = Field("arm", "m", "length of the arm", lower=0, open_lower=True)
SHAPE = Field("shape", "1", "shape of the arm", default=3.0, choices={"round": 0, "square": 3})
MASSES = Field("masses", "kg", "masses of the beads", dims=("bead",), lower=0)
GRIP = Field("grip", "m", "grip", default="arm")
DRAG = Field("drag", "1/s", "drag", default=0.25, lower=0, upper=1)
BEAD = Field("bead", "1", "number of the bead", lower=1, integer=True)
PHASE = Field("phase", "1", "time over period", lower=0, upper=1)
LIFT = Field("lift", "m", "lift of each bead", dims=("bead", "phase"))


def solve(*columns):
    """Solves nothing."""


MADE = Kernel(
    name="made",
    doc="an arm with beads.\nSecond line.",
    source="",
    parameters=(ARM, SHAPE, MASSES, GRIP, DRAG),
    outputs=(Field("period", "s", "period of the arm"), LIFT),
    check=solve,
    methods=(
        Method("quick", "no drag", solve, solve, excludes=("drag", "grip"), lacks=("lift",)),
        Method("slow", "all of it", solve),
    ),
    along=(BEAD, PHASE),
    example={"arm": 0.5, "masses": [1.0, 0.25], "drag": 0.125},
)

SHORT = """made: an arm with beads.
  parameters  arm [m], shape [1] = square, masses [kg], grip [m] = arm, drag [1/s] = 0.25
  outputs     period [s], lift [m] along bead and phase
  methods     quick, slow"""

TEXT = """made: an arm with beads.
Second line.

parameters
  arm     [m]    > 0                  required        length of the arm
  shape   [1]    "round" or "square"  default square  shape of the arm
  masses  [kg]   >= 0                 required        masses of the beads, one for each bead
  grip    [m]                         default arm     grip
  drag    [1/s]  >= 0, <= 1           default 0.25    drag

outputs
  period  [s]                        period of the arm
  lift    [m]  along bead and phase  lift of each bead

coordinates that all cells share
  bead   [1]  >= 1        number of the bead
  phase  [1]  >= 0, <= 1  time over period

methods, cheapest first; "auto" takes the first whose error bound meets rtol
  quick  states its error  no drag; cannot do drag or grip; does not give lift
  slow   keeps rtol        all of it

a study to begin with
  kernel = "made"

  [axes.arm]
  spacing = "linear"
  start = 0.4
  stop = 0.6
  num = 41
  unit = "m"

  [fixed]
  masses = { value = [1, 0.25], unit = "kg" }
  drag = { value = 0.125, unit = "1/s" }

  [along.bead]
  num = 10

  [along.phase]
  num = 200"""


@pytest.fixture(autouse=True)
def _made(monkeypatch):
    monkeypatch.setattr(kernels, "load_kernel", lambda name, *_: MADE)


def test_a_kernel_is_told_in_full():
    assert kernels.kernel_text("made") == TEXT


def test_a_kernel_of_the_catalogue_is_told_in_four_lines():
    assert kernels._short("made") == SHORT


def test_the_source_stands_below_the_name(monkeypatch):
    monkeypatch.setattr(kernels, "load_kernel", lambda *_: Kernel("x", "A stone.", "Newton", (ARM,), (), solve, ()))
    assert kernels.kernel_text("x").startswith("x: A stone.\n\nSource: Newton\n\nparameters\n")


def test_a_study_to_begin_with_asks_a_question():
    study = "\n".join(line.removeprefix("  ") for line in TEXT.split("a study to begin with\n")[1].splitlines())
    question = "# An arm with beads.: how does it change with its parameters?"
    assert kernels.starter("made") == f"{question}\n{study}\n"


@pytest.mark.parametrize(
    ("field", "lines"),
    [
        (SHAPE, ['values = ["round", "square"]']),
        (Field("n", "1", "", lower=4, integer=True), ["values = [4, 5, 6]"]),
        (Field("n", "1", "", lower=-3, integer=True), ["values = [1, 2, 3]"]),
        (DRAG, ['spacing = "log"', "start = 0.2", "stop = 20", "num = 41", 'unit = "1/s"']),
        (ARM, ['spacing = "linear"', "start = 1.6", "stop = 2.4", "num = 41", 'unit = "m"']),
    ],
)
def test_an_axis_to_begin_with_is_around_the_example(field, lines):
    assert list(kernels._axis(field, 2.0)) == [f"[axes.{field.name}]", *lines]


@pytest.mark.parametrize(
    ("low", "high", "unit", "lines"),
    [
        (-math.inf, math.inf, "rad", ['spacing = "linear"', "start = 0", "stop = 360", "num = 181", 'unit = "degree"']),
        (0.0, 6.3, "rad", ['spacing = "linear"', "start = 0", "stop = 360", "num = 181", 'unit = "degree"']),
        (-3.1, 3.1, "rad", ["num = 200"]),
        (0.0, 7.0, "1", ["num = 200"]),
        (0.0, math.inf, "m", ['spacing = "linear"', "start = 0", "stop = 0.1", "num = 51", 'unit = "m"']),
        (0.0, math.inf, "s", ['spacing = "log"', "start = 0.1", "stop = 100", "num = 200", 'unit = "s"']),
    ],
)
def test_a_coordinate_to_begin_with_covers_what_it_may_be(low, high, unit, lines):
    assert list(kernels._range(Field("q", unit, "", lower=low, upper=high))) == lines


def test_an_example_fixes_the_first_word_and_takes_one_for_a_number_without_example():
    assert kernels._entry(SHAPE, 3.0) == 'shape = "round"'
    bare = Kernel("b", "Bare.", "", (MASSES, ARM, Field("mu", "1", "")), (), solve, (), example={"masses": [2.0]})
    assert kernels._example("b", bare).splitlines()[-3:] == [
        "[fixed]",
        'masses = { value = [2], unit = "kg" }',
        'mu = { value = 1, unit = "1" }',
    ]
    alone = Kernel("b", "Bare.", "", (ARM, DRAG), (), solve, ())
    assert "[fixed]" not in kernels._example("b", alone)
