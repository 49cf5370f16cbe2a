"""Numbers of a study: spacings against 60 digits, units, sampled designs against scipy's generators, blocks."""

import math
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import pandas as pd
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import qmc
from toy_studies import build, message_of

import sweep
from sweep.units import UnitMistake, scale

RANGES = {
    "height": {"spacing": "log", "start": 1.0, "stop": 1e4},
    "v0": {"spacing": "linear", "start": 2.0, "stop": 5.0},
}
BLOCKS = [
    {"design": "zip", "axes": {"height": [1.0, 2.0, 3.0], "v0": [0.0, 1.0, 0.5]}},
    {"axes": {"g": [9.81, 1.62]}},
]


def sampled(kind="sobol", n=8, seed=3, axes=RANGES, **options):
    return build(design={"kind": kind, "n": n, "seed": seed, **options}, axes=axes)


def heights(**axis):
    return build(axes={"height": axis}).axes["height"].values


# spacings and units


@given(
    st.floats(1e-20, 1e20), st.floats(1e-20, 1e20), st.integers(2, 30),
    st.sampled_from(["log", "linear"]), st.sampled_from([("m", 1), ("mm", Decimal("0.001")), ("km", 1000)]),
)  # fmt: skip
def test_values_are_the_nearest_floats_to_the_true_ones_and_end_exactly(start, stop, num, spacing, unit):
    if abs(start - stop) < 1e-6 * start:
        return
    values = heights(spacing=spacing, start=start, stop=stop, num=num, unit=unit[0])
    # the decimals that the user wrote, not the floats they became; fractions, as a value may lie between two floats
    first, last = (Fraction(repr(end)) * Fraction(unit[1]) for end in (start, stop))
    truth = [float((first * (num - 1 - i) + last * i) / (num - 1)) for i in range(num)]
    with mpmath.workdps(60):
        if spacing == "log":
            ratio = (mpmath.mpf(repr(stop)) / mpmath.mpf(repr(start))) ** (mpmath.mpf(1) / (num - 1))
            factor = mpmath.mpf(repr(start)) * mpmath.mpf(str(unit[1]))
            truth[1:-1] = [float(factor * ratio**i) for i in range(1, num - 1)]
    assert values.tolist() == truth
    assert (np.diff(values) * (stop - start) > 0).all()


def test_a_unit_does_to_a_spacing_what_it_does_to_values_one_by_one():
    for spacing, listed in (("log", [1, 10, 100, 1000]), ("linear", [1, 334, 667, 1000])):
        spaced = heights(spacing=spacing, start=1, stop=1000, num=4, unit="mm").tolist()
        fixed = [build(axes={"height": [1.0]}, fixed={"v0": {"value": n, "unit": "mm/s"}}).fixed["v0"] for n in listed]
        assert spaced == heights(values=listed, unit="mm").tolist() == fixed == [n / 1000 for n in listed]


def test_edges_of_bins_may_be_spaced_as_axes_are_and_in_another_unit():
    edges = {"fall_time": {"spacing": "log", "start": 100, "stop": 1e4, "num": 3, "unit": "ms"}}
    summary = {"outputs": {"fall_time": ["histogram"]}, "edges": edges}
    found = sweep.run(build(axes={"height": [1.0, 2.0, -1.0]}, summary=summary))
    np.testing.assert_array_equal(found.fall_time_bin_lower, [0.1, 1.0])
    np.testing.assert_array_equal(found.fall_time_bin_upper, [1.0, 10.0])
    assert found.fall_time_histogram.values.tolist() == [2, 0]


@pytest.mark.parametrize(
    ("given", "wanted", "factor"),
    [
        ("degree", "rad", math.pi / 180), ("ms", "s", 0.001), ("g cm^2", "kg m^2", 1e-7),
        ("rpm", "rad/s", 2 * math.pi / 60), ("rpm", "Hz", 1 / 60), ("percent", "1", 0.01), ("", "1", 1),
        ("degree/s^2", "rad/s^2", math.pi / 180), ("N m/degree", "N m/rad", 180 / math.pi),
        ("Hz", "rad/s", 2 * math.pi), ("kHz", "rad/s", 2000 * math.pi), ("rad/s", "Hz", 1 / (2 * math.pi)),
        # rad may be left out
        ("1/s", "rad/s", 1), ("1/s", "Hz", 1), ("1", "rad", 1), ("N m", "N m/rad", 1), ("N m/(kg m^2)", "rad/s^2", 1),
    ],
)  # fmt: skip
def test_a_unit_becomes_the_factor_to_the_field(given, wanted, factor):
    assert float(scale(given, wanted, "x")) == pytest.approx(
        factor, rel=2.3e-16, abs=0.0
    )  # an ulp: factor is rounded too


def test_the_unit_of_the_field_needs_no_pint_and_malformed_ones_are_refused():
    code = "import sys; from sweep.units import scale; scale('rad/s', 'rad/s', 'x'); sys.exit('pint' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
    for text in ("m/", "(((", "m*", "rad s-2", "3 m", "m**m", "m^", "\n", "m;m", "__import__('os')", "💥"):
        with pytest.raises(UnitMistake):
            scale(text, "m", "x")
    for text, wanted, what in (("degC", "K", "offset"), ("m Hz", "m/s", "Hz inside"), ("dB", "1", "multiple")):
        with pytest.raises(UnitMistake, match=what):
            scale(text, wanted, "x")


def test_what_is_masked_is_no_number():
    masked = np.ma.array([1.0, 2.0], mask=[False, True])
    found = sweep.study(kernel="foliot", axes={"mu": masked}, fixed={"phi0": 1.0, "a": 1.0}).axes["mu"].values
    assert (found[0], np.isnan(found[1])) == (1.0, True)


def test_numbers_that_have_a_unit_themselves_are_converted():
    """Quantities of pint, and what `in_units` gives: 180 degree are pi rad."""
    keys, of_pint = {"kernel": "foliot", "axes": {"mu": [1.0]}}, pint.UnitRegistry().Quantity
    half = of_pint(180, "degree")
    assert sweep.study(**keys, fixed={"phi0": half, "a": of_pint(60.0, "1/min")}).fixed["phi0"] == math.pi
    keys["fixed"] = {"phi0": 1.0, "a": 1.0}
    study = sweep.study(**keys | {"axes": {"mu": of_pint([1.0, 180.0], "degree/s^2")}})
    assert study.axes["mu"].values.tolist() == pytest.approx([math.pi / 180, math.pi], abs=0.0, rel=1e-15)
    in_degrees = sweep.in_units(sweep.run(study), {"mu": "degree/s^2"}).mu
    for entry in (in_degrees, {"values": in_degrees}):
        again = sweep.study(**keys | {"axes": {"mu": entry}})
        np.testing.assert_allclose(again.axes["mu"].values, study.axes["mu"].values, rtol=1e-15)
    of_pandas = sweep.study(**keys | {"axes": {"mu": pd.array([1, None], "Int64")}})  # what is missing is no number
    np.testing.assert_array_equal(of_pandas.axes["mu"].values, [1.0, np.nan])
    for entry, where in (
        (of_pint([1.0], "kg"), "axes.mu"),
        ({"values": in_degrees, "unit": "rad/s^2"}, "axes.mu.unit"),
        ({"spacing": "log", "start": in_degrees[0], "stop": 10.0, "num": 2}, "axes.mu.start"),
        ({"spacing": "log", "start": 1.0, "stop": of_pint(3.0, "rad/s^2"), "num": 2, "unit": "1/s^2"}, "axes.mu.stop"),
    ):
        assert message_of(lambda entry=entry: sweep.study(**keys | {"axes": {"mu": entry}}), where)


# sampled designs


@pytest.mark.parametrize(
    ("kind", "options", "points"),
    [
        ("sobol", {}, lambda rng: qmc.Sobol(2, rng=rng).random(8)),
        ("sobol", {"scramble": False}, lambda rng: qmc.Sobol(2, scramble=False).random(8)),
        ("latin", {}, lambda rng: qmc.LatinHypercube(2, rng=rng).random(8)),
        ("random", {}, lambda rng: rng.random((8, 2))),
    ],
)
def test_points_are_those_of_scipy_within_the_ranges(kind, options, points):
    study = sampled(kind, **options)
    height, v0 = points(np.random.default_rng(3)).T
    np.testing.assert_allclose(np.log10(study.axes["height"].values) / 4, height, rtol=0, atol=1e-15)
    np.testing.assert_allclose(study.axes["v0"].values, 2 + 3 * v0, rtol=1e-15)
    found = sweep.run(study)
    assert (found.fall_time.dims, found.attrs["design"]) == (("cell",), kind)
    np.testing.assert_array_equal(found.height, study.axes["height"].values)


def test_the_designs_of_sensitivity_change_one_axis_at_a_time():
    pytest.importorskip("SALib")
    axes = {name: {"spacing": "linear", "start": 0.0, "stop": 1.0} for name in ("height", "v0")}
    morris, saltelli = (
        np.stack([a.values for a in sampled(kind, 4, 2, axes).axes.values()], axis=1) for kind in ("morris", "saltelli")
    )
    assert set(np.round(np.unique(morris) * 3, 12)) <= {0.0, 1.0, 2.0, 3.0}
    assert ((np.diff(morris.reshape(4, 3, 2), axis=1) != 0).sum(axis=2) == 1).all()
    first, *changed, other = saltelli.reshape(4, 4, 2).transpose(1, 0, 2)
    for k, points in enumerate(changed):
        np.testing.assert_array_equal(points[:, k], other[:, k])
        np.testing.assert_array_equal(points[:, 1 - k], first[:, 1 - k])


@pytest.mark.parametrize(
    ("design", "where", "message"),
    [
        ({"kind": "sobol", "n": 12}, "design.n", "write 8 or 16"),
        ({"kind": "random", "n": 8, "scramble": True}, "design.scramble", "no such key"),
        ({"kind": "zip", "n": 8}, "design.n", "no such key"),
        ({"kind": "saltelli", "n": 2**23}, "design.n", "at most"),
    ],
)
def test_what_is_wrong_with_a_design_is_told(design, where, message):
    assert message in message_of(lambda: build(design=design, axes=RANGES), where)


@pytest.mark.parametrize("entry", [[1.0, 2.0], {"values": [1.0]}, {**RANGES["v0"], "num": 8}])
def test_a_sampled_axis_has_no_values_of_its_own(entry):
    found = message_of(lambda: sampled(axes={"v0": entry, "height": RANGES["height"]}), "axes.v0")
    assert "the design chooses the values" in found


# blocks


def test_arrays_go_into_a_block_of_their_own():
    arrays = {"design": "zip", "axes": {"mass": [[1.0, 2.0], [3.0, 4.0]], "place": [[1.0, 1.0], [2.0, 2.0]]}}
    keys = {"kernel": "beads:KERNEL", "outputs": ["moment"], "allow_import": True}
    found = sweep.run(**keys, blocks=[{"axes": {"g": [9.80665, 1.6]}}, arrays])
    assert found.mass.dims == ("point", "bead")
    np.testing.assert_array_equal(found.moment.isel(g=0), sweep.run(**keys, **arrays).moment)


@pytest.mark.parametrize(
    ("keys", "where"),
    [
        ({"blocks": BLOCKS, "axes": {"g": [1.0]}}, "axes"),
        ({"blocks": BLOCKS, "design": "zip"}, "design"),
        ({"blocks": {}}, "blocks"),
        ({"blocks": []}, "blocks"),
        ({"blocks": BLOCKS, "summary": {"over": ["height"]}}, "summary.over"),
        ({"blocks": [3]}, "blocks[0]"),
        ({"blocks": [*BLOCKS, {"axes": {"g": [1.0]}}]}, "blocks[2].axes.g"),
        ({"blocks": [*BLOCKS, {"axes": {"h": [1.0]}}]}, "blocks[2].axes.h"),
        ({"blocks": [{"design": "zip", "axes": {"g": [1.0], "v0": [1.0, 2.0]}}]}, "blocks[0].axes"),
        ({"blocks": [{"axes": {"height": [1.0, 1.0]}}, {"axes": {"v0": [0.0, 0.0]}, "design": "zip"}]},
         "blocks[0].axes.height"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_blocks_is_told_where_it_stands(keys, where):
    assert message_of(lambda: build(**keys), where)
