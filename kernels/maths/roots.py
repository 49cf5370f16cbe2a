"""Roots of an equation in one unknown, for one cell or lanes: each cell's search ends independently and is then frozen.

The equation is `trial`, a compiled function of the unknown and of a record or tuple of its parameters. It decides
itself when to stop, because it knows its rounding error; the step that it declares the last is still made.
"""

from kernels.lanes.jit import jit
from kernels.lanes.vectors import any_lane, magnitude, not_, where


@jit
def by_steps(trial, x, active, scene, limit):
    """The root by Newton's or Halley's steps from x in the active cells, and in which the limit was reached.

    trial(x, scene) -> step, last : x - step comes next; whether it is near enough
    """
    for _ in range(limit):
        if not any_lane(active):
            break
        step, last = trial(x, scene)
        x, active = where(active, x - step, x), active & not_(last)
    return x, active


@jit
def in_bracket(trial, x, low, high, active, scene, limit, beyond):
    """The root between `low` and `high` by Newton's steps from x, bisections where they leave the bracket; as above.

    trial(x, scene) -> below, step, near : whether the root is above x; x + step comes next, if it is in the bracket, or
        no longer than `beyond`; the search ends with a step as short as `near`, and where it is for one below 0
    """
    for _ in range(limit):
        if not any_lane(active):
            break
        below, step, near = trial(x, scene)
        low, high = where(below, x, low), where(below, high, x)
        new = x + step
        own = (magnitude(step) <= beyond) | ((new >= low) & (new <= high))
        new = where(own, new, 0.5 * (low + high))
        last, active = magnitude(new - x) <= near, active & not_(near < 0.0)
        x, active = where(active, new, x), active & not_(last)
    return x, active
