"""Designs: sampled points by scipy's generators, blocks, and what comes of them in a result."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import qmc
from toy_studies import build, message_of

import sweep
from sweep.study.model import Study

RANGES = {
    "height": {"spacing": "log", "start": 1.0, "stop": 1e4},
    "v0": {"spacing": "linear", "start": 2.0, "stop": 5.0},
}


def sampled(kind="sobol", n=8, seed=3, axes=RANGES, **options):
    return build(design={"kind": kind, "n": n, "seed": seed, **options}, axes=axes)


GENERATED = {
    "sobol": lambda: qmc.Sobol(2, rng=np.random.default_rng(3)).random(8),
    "latin": lambda: qmc.LatinHypercube(2, rng=np.random.default_rng(3)).random(8),
    "random": lambda: np.random.default_rng(3).random((8, 2)),
}


@pytest.mark.parametrize("kind", GENERATED)
def test_points_are_those_of_scipy_within_the_ranges(kind):
    found = sampled(kind)
    height, v0 = GENERATED[kind]().T
    assert np.allclose(np.log10(found.axes["height"].values) / 4, height, rtol=0, atol=1e-15)
    assert np.allclose(found.axes["v0"].values, 2 + 3 * v0, rtol=1e-15)
    assert found.dims == {"cell": ("height", "v0")}


def test_scrambling_can_be_switched_off():
    plain = qmc.Sobol(2, scramble=False).random(8)
    assert np.array_equal(sampled(scramble=False).axes["v0"].values, 2 + 3 * plain[:, 1])


def test_points_are_coordinates_of_the_result():
    study = sampled()
    found = sweep.run(study)
    assert found.fall_time.dims == ("cell",)
    assert np.array_equal(found.height, study.axes["height"].values)
    assert found.attrs["design"] == "sobol"
    assert np.allclose(found.height, found.v0 * found.fall_time + found.g * found.fall_time**2 / 2, rtol=1e-8)


@pytest.mark.parametrize(
    ("design", "where", "message"),
    [
        ("sobol", "design", "how many points?"),
        ({"kind": "sobol", "n": 12}, "design.n", "needs a power of 2; write 8 or 16"),
        ({"kind": "latin"}, "design.n", "expected a whole number, found nothing"),
        ({"kind": "latin", "n": 1}, "design.n", "expected at least 2, found 1"),
        ({"kind": "latin", "n": 8, "seed": -1}, "design.seed", "from 0 to 4294967295, found -1"),
        ({"kind": "latin", "n": 8, "seed": 1.5}, "design.seed", "expected a whole number"),
        ({"kind": "random", "n": 8, "scramble": True}, "design.scramble", "no such key"),
        ({"kind": "latin", "n": 8, "scramble": 1}, "design.scramble", "expected true or false, found 1"),
        ({"kind": "latn", "n": 8}, "design.kind", "did you mean latin?"),
        ({"kind": "zip", "n": 8}, "design.n", "no such key"),
        ({"kind": "latin", "n": 10_000_001}, "design.n", "expected at most 10000000"),
    ],
)
def test_what_is_wrong_with_a_design_is_told(design, where, message):
    assert message in message_of(lambda: build(design=design, axes=RANGES), where)


@pytest.mark.parametrize("entry", [[1.0, 2.0], {"values": [1.0]}, {**RANGES["v0"], "num": 8}])
def test_a_sampled_axis_has_no_values_of_its_own(entry):
    found = message_of(lambda: sampled(axes={"v0": entry, "height": RANGES["height"]}), "axes.v0")
    assert "the design chooses the values" in found


BLOCKS = [
    {"design": "zip", "axes": {"height": [1.0, 2.0, 3.0], "v0": [0.0, 1.0, 0.5]}},
    {"axes": {"g": [9.81, 1.62]}},
]


def test_blocks_are_a_product_of_designs():
    study = build(blocks=BLOCKS)
    found = sweep.run(study)
    assert dict(found.sizes) == {"point": 3, "g": 2}
    assert found.height.dims == found.v0.dims == ("point",)
    time = found.fall_time
    assert np.allclose((found.v0 * time + found.g * time**2 / 2).T, found.height, rtol=1e-8)


def test_a_sampled_block_is_repeated_over_another():
    sobol = {"design": {"kind": "sobol", "n": 4}, "axes": {"height": RANGES["height"]}}
    found = sweep.run(build(blocks=[sobol, {"axes": {"v0": [0.0, 1.0, 2.0]}}]))
    assert found.fall_time.shape == (4, 3)
    assert (np.diff(found.fall_time, axis=1) < 0).all()


def test_arrays_go_into_a_block_of_their_own():
    arrays = {"design": "zip", "axes": {"J": [[1.0, 2.0], [3.0, 4.0]], "k": [[1.0, 1.0], [2.0, 2.0]]}}
    keys = {"kernel": "drivetrain", "outputs": ["frequency"], "fixed": {"f_max": 1.0}}
    found = sweep.run(sweep.study(**keys, blocks=[{"axes": {"tol": [0.0, 0.01]}}, arrays]))
    alone = sweep.run(sweep.study(**keys, **arrays))
    assert found.J.dims == ("point", "mass")
    assert np.array_equal(found.frequency.isel(tol=0), alone.frequency.rename(cell="point"), equal_nan=True)


@pytest.mark.parametrize(
    ("keys", "where", "message"),
    [
        ({"blocks": BLOCKS, "axes": {"g": [1.0]}}, "axes", "does not go with blocks"),
        ({"blocks": BLOCKS, "design": "zip"}, "design", "does not go with blocks"),
        ({"blocks": {}}, "blocks", "expected a list of tables"),
        ({"blocks": []}, "blocks", "expected a list of tables"),
        ({"blocks": [3]}, "blocks[0]", "expected a table, found 3"),
        ({"blocks": [{"axis": {}}]}, "blocks[0].axis", "did you mean axes?"),
        ({"blocks": [*BLOCKS, {"axes": {"g": [1.0]}}]}, "blocks[2].axes.g", "is an axis of another block"),
        ({"blocks": [*BLOCKS, {"axes": {"h": [1.0]}}]}, "blocks[2].axes.h", "no such parameter"),
        ({"blocks": [{"design": "zip", "axes": {"g": [1.0], "v0": [1.0, 2.0]}}]}, "blocks[0].axes", "equal length"),
        ({"blocks": BLOCKS, "fixed": {"v0": 1.0}}, "fixed.v0", "is an axis as well"),
    ],
)
def test_what_is_wrong_with_blocks_is_told(keys, where, message):
    assert message in message_of(lambda: build(**keys), where)


def test_a_summary_reduces_a_block_as_a_whole():
    over = {"over": ["height", "v0"], "outputs": {"fall_time": ["min", "argmin", "mean"]}}
    blocks = sweep.run(build(blocks=BLOCKS, summary=over))
    cells = sweep.run(build(blocks=BLOCKS)).fall_time
    assert blocks.fall_time_min.dims == ("g",)
    assert np.array_equal(blocks.fall_time_min, cells.min("point"))
    first = cells.isel(point=cells.argmin("point"))
    assert np.array_equal(blocks.fall_time_argmin_height, first.height)
    wrong = {"over": ["height"], "outputs": {"fall_time": ["min"]}}
    assert "run together" in message_of(lambda: build(blocks=BLOCKS, summary=wrong), "summary.over")


@settings(deadline=None, max_examples=10)
@given(block=st.integers(1, 40), kind=st.sampled_from(["sobol", "latin", "random"]))
def test_the_bits_are_the_same_for_any_blocks_of_cells(block, kind):
    keys = {"blocks": [{"design": {"kind": kind, "n": 8, "seed": 1}, "axes": RANGES}, {"axes": {"g": [9.81, 1.62]}}]}
    keys["where"] = "v0**2 < 2*g*height"
    study = build(**keys)
    whole, cut = sweep.run(study), sweep.run(study, block_cells=block, workers=1)
    assert whole.fall_time.values.tobytes() == cut.fall_time.values.tobytes()
    assert np.array_equal(whole.status, cut.status)


@pytest.mark.parametrize(
    "study", [sampled(), build(blocks=BLOCKS), build(axes={"g": [1.0, 2.0]}, fixed={"height": 1.0}, where="g > 1")]
)
def test_a_design_is_kept_in_json(study):
    again = Study.from_json(study.to_json(), allow_import=True)
    assert again == study
    assert again.dims == study.dims
    assert again != replace(study, where="g > 3")
