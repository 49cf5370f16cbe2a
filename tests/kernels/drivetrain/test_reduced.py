"""Reduced drivetrains against 50 digits, against the source's tables, and against their own laws."""

import numpy as np
import pytest
import reduction_oracles as oracles
from chain_oracles import frequencies
from columns import checked, estimated, relative_error, solve

from kernels.drivetrain.reduced import DRIVETRAIN, ORDERS, REDUCTIONS
from kernels.interface import Status
from kernels.lanes.jit import COMPILED

BASES = ("guyan", "irs", "craig_bampton", "modal")
REDUCING = ("rivin", *BASES, "exact")
FULA = {
    "J": np.array([25.7, 1.25, 0.284, 0.769, 1.45, 6.5, 96.0, 99.44]) * 1e-3,
    "k": np.array([7.53, 3.79, 0.839, 1.372, 4.01, 2.80, 5.25, 1.192]) * 1e3,
    "h": np.array([0.18, 0.042, 0.019, 0.037, 0.0975, 0.187, 0.72, 13.0]),
}
"""Main drive of the Fu-la milling machine, Table 1, in units of kgf, m and s."""


def reduced(reduction, chain=FULA, rtol=1e-9, order="strict", asked=None, **named):
    """Outputs by name, and status, of cells; scalars of one cell."""
    codes = {"reduction": float(REDUCTIONS[reduction]), "order": float(ORDERS[order])}
    columns = {name: np.atleast_1d(np.asarray(v, float)) for name, v in (codes | named).items()}
    chain = {name: np.atleast_2d(v) for name, v in chain.items()}
    outputs, status = solve(DRIVETRAIN, "direct", rtol=rtol, asked=asked, **chain, **columns)
    return outputs, [Status(s) for s in status]


def random_chain(seed, n, decades=2.0, damping=-2.0):
    """A chain with inertias and stiffnesses over so many decades, and dampers of that power of ten."""
    random = np.random.default_rng(seed)
    J, k = 10 ** random.uniform(0, decades, n), 10 ** random.uniform(0, decades, n)
    return {"J": J, "k": k, "h": np.sqrt(J * k) * 10 ** (damping + random.uniform(-1, 0, n))}


def model_of(reduction, chain, n_keep):
    """The reduced model by the oracle."""
    values = list(chain.values())
    if reduction == "exact":
        return oracles.full(*values)
    if reduction == "rivin":
        return oracles.full(*oracles.rivin(*values, oracles.strict_steps(*values, n_keep)))
    return oracles.Reduced(reduction, *values, n_keep, oracles.masters(*values, n_keep))


SIZES = [(1, 6, 2.0), (2, 7, 6.0), (3, 8, 12.0), (4, 2, 3.0), (5, 12, 4.0)] if COMPILED else [(1, 4, 3.0)]


@pytest.mark.parametrize(("seed", "n", "decades"), SIZES)
def test_the_reduced_chain_is_that_of_the_levers_to_a_few_ulp(seed, n, decades):
    chain = random_chain(seed, n, decades)
    for n_keep in {1, n // 2, n - 1}:
        outputs, _ = reduced("rivin", chain, n_keep=n_keep)
        truth = oracles.rivin(*chain.values(), oracles.strict_steps(*chain.values(), n_keep))
        for name, values in zip(("J_kept", "k_kept", "h_kept"), truth, strict=True):
            assert relative_error(outputs[name][0, :n_keep], values).max() < 2e-14, name
            assert np.isnan(outputs[name][0, n_keep:]).all()
        assert relative_error(outputs["frequency"][0, :n_keep], frequencies(*truth[:2], 60)).max() < 1e-13


@pytest.mark.parametrize("reduction", BASES)
@pytest.mark.parametrize(("seed", "n", "decades"), SIZES)
def test_frequencies_in_a_basis_are_right_or_said_not_to_be(reduction, seed, n, decades):
    chain = random_chain(seed, n, decades)
    for n_keep in {1, (n + 1) // 2, n - 1}:
        truth = model_of(reduction, chain, n_keep).frequencies()
        outputs, status = reduced(reduction, chain, n_keep=n_keep, rtol=1e-10)
        error = relative_error(outputs["frequency"][0, :n_keep], truth).max()
        assert status[0] in (Status.OK, Status.INACCURATE, Status.DAMPERS_OUT_OF_RANGE)
        assert error < 1e-10 or status[0] == Status.INACCURATE
        if decades < 5:
            assert error < 1e-12


@pytest.mark.parametrize("seed_n_damping", [(11, 5, -0.7), (12, 4, 0.8)])
@pytest.mark.parametrize("reduction", ["rivin", *BASES])
def test_damping_is_that_of_the_poles_in_30_digits(reduction, seed_n_damping):
    """The second chain has modes that are overdamped."""
    seed, n, damping = seed_n_damping
    chain = random_chain(seed, n, 2.0, damping)
    outputs, status = reduced(reduction, chain, n_keep=n - 2)
    expected = oracles.dampings(model_of(reduction, chain, n - 2).poles())
    assert status[0] in (Status.OK, Status.DAMPERS_OUT_OF_RANGE)
    assert relative_error(np.sort(outputs["damping"][0, : n - 2]), sorted(expected)).max() < 1e-11


@pytest.mark.parametrize("reduction", ["none", "rivin", *BASES] if COMPILED else ["irs"])
def test_damping_by_one_damper_that_some_modes_hardly_feel_is_right_or_said_not_to_be(reduction):
    """A damping of 1e-12 has fewer digits than its pole."""
    right = 0
    for seed in (0, 3, 7, 9, 11):
        chain = random_chain(seed, 5, 6.0, -1.0)
        chain["h"][np.arange(5) != seed % 5] = 0.0
        n_keep = 0 if reduction == "none" else 4
        outputs, status = reduced(reduction, chain, asked=("damping",), n_keep=n_keep)
        expected = oracles.dampings(model_of("exact" if n_keep == 0 else reduction, chain, 4).poles())
        fine = relative_error(outputs["damping"][0, : len(expected)], expected).max() < 1e-9
        assert fine or status[0] == Status.INACCURATE
        right += status[0] != Status.INACCURATE
    assert right > 0


def test_damping_of_two_modes_that_are_alike_but_for_a_heavy_mass_between_them():
    """Their poles are 1e-7 of them apart, in each of three pairs."""
    half = {"J": [83.0, 0.0146, 0.5], "k": [0.0764, 76.5, 7.77e7], "h": [5e-9, 8e-9, 1e-3]}
    middle, end = {"J": [1e5], "k": [7.77e7], "h": [0.34]}, {"J": [], "k": [1e-9], "h": [7e-9]}
    back = {"J": half["J"][::-1], "k": half["k"][1::-1], "h": [2.4e-8, 3e-11]}
    chain = {name: np.array(half[name] + middle[name] + back[name] + end[name]) for name in "Jkh"}
    outputs, status = reduced("none", chain, 1e-7, asked=("damping",))
    expected = oracles.dampings(oracles.full(*chain.values()).poles())
    assert status[0] == Status.OK
    assert relative_error(outputs["damping"][0], expected).max() < 1e-7


def test_the_bound_of_an_irs_frequency_knows_of_angles_that_are_small():
    """A free chain with all of its inertia at the second master, which hardly moves, and others with it."""
    J = np.array([0.0121, 170.6, 15.27, 6.37, 0.176, 1.41, 1.06, 0.0148, 1.96])
    k = np.array([0.477, 1.033, 0.463, 1.875, 8.36, 0.572, 2.18, 5.79, 0.0])
    for scale in 1.0 + 0.1 * np.arange(10):
        chain = {"J": J * np.append(scale, np.ones(8)), "k": k, "h": np.zeros(9)}
        truth = oracles.Reduced("irs", *chain.values(), 2, [0, 1]).frequencies()[1]
        columns = {name: values[None] for name, values in chain.items()} | {"n_keep": 2.0}
        kind, asked = float(REDUCTIONS["irs"]), ("frequency",)
        outputs, _, error = estimated(DRIVETRAIN, "direct", reduction=kind, asked=asked, **columns)
        assert relative_error(outputs["frequency"][0, 1:2], [truth])[0] <= error[0]


def spindle(model):
    """Receptance of the spindle at frequencies [Hz], in numpy."""
    K, C, M, here = (np.array(m.tolist(), float) for m in (model.K, model.C, model.M, model.here))
    rest = float(model.rest)

    def receptance(f):
        w = 2 * np.pi * f[:, None, None]
        return rest + np.einsum("ai,nij,bj->n", here, np.linalg.inv(K + 1j * w * C - w * w * M), here)

    return receptance


def scanned(function, f_max):
    """The largest absolute value up to f_max: of 20001, and of 2001 beside the largest of them, to 1e-9."""
    f = np.linspace(0.0, f_max, 20001)
    best, step = f[abs(function(f)).argmax()], f[1]
    return abs(function(np.linspace(max(best - step, 0.0), min(best + step, f_max), 2001))).max()


@pytest.mark.parametrize("f_max", [15.0, 100.0, 400.0] if COMPILED else [100.0])
@pytest.mark.parametrize("reduction", ["rivin", *BASES])
def test_the_error_of_the_receptance_is_the_largest_that_a_fine_scan_finds(reduction, f_max):
    outputs, _ = reduced(reduction, n_keep=5, f_max=f_max)
    model = model_of(reduction, FULA, 5)
    here, true = spindle(model), spindle(oracles.full(*FULA.values()))
    found = scanned(lambda f: here(f) - true(f), f_max) / scanned(true, f_max)
    assert outputs["frf_error"][0] == pytest.approx(found, rel=1e-8)


def test_the_error_of_the_receptance_is_looked_for_where_dampers_let_springs_creep():
    """Far below the lowest frequency, where the springs' 1e-3 to 1e-6 of it are passed."""
    chain = {"J": np.ones(4), "k": np.array([1.0, 0.5, 2.0, 3.0]), "h": 10.0 ** np.arange(3, 7)}
    outputs, _ = reduced("craig_bampton", chain, n_keep=3, f_max=1.0)
    here, true = spindle(model_of("craig_bampton", chain, 3)), spindle(oracles.full(*chain.values()))
    f = np.geomspace(1e-10, 1.0, 30_001)
    assert outputs["frf_error"][0] == pytest.approx(abs(here(f) - true(f)).max() / abs(true(np.zeros(1)))[0], rel=1e-6)


def test_the_error_of_the_receptance_is_followed_to_its_top_between_two_poles_that_are_all_but_one():
    """Model and chain differ by 1e-7, less than rounding tells of values beside either."""
    chain = {"J": np.full(2, 3.428462117598482), "k": np.array([9.39230334855602e-06, 1.0]),
             "h": np.array([0.00018472864616976293, 0.005947580025709261])}  # fmt: skip
    outputs, _ = reduced("craig_bampton", chain, n_keep=1, f_max=1e-3)
    here, true = spindle(model_of("craig_bampton", chain, 1)), spindle(oracles.full(*chain.values()))
    found = scanned(lambda f: here(f) - true(f), 1e-3) / scanned(true, 1e-3)
    assert outputs["frf_error"][0] == pytest.approx(found, rel=1e-6)


@pytest.mark.parametrize(("seed", "n", "decades"), SIZES)
def test_frequencies_of_the_exact_reduction_are_those_of_the_full_chain_to_a_few_ulp(seed, n, decades):
    """It has no error; also where the chain is free."""
    chain = random_chain(seed, n, decades)
    for k in (chain["k"], np.append(chain["k"][:-1], 0.0)):
        truth = frequencies(chain["J"], k, 60)
        free = int(k[-1] == 0.0)
        for n_keep in {1, n // 2, n - 1}:
            outputs, status = reduced("exact", chain | {"k": k}, n_keep=n_keep, f_max=1.0)
            assert status[0] == Status.OK
            assert outputs["frequency"][0, :free].tolist() == [0.0] * free
            assert relative_error(outputs["frequency"][0, free:], truth[free:]).max() < 3e-15
            assert abs(outputs["frequency_error"][0]).max() < 5e-15
            assert free or outputs["frf_error"][0] < 1e-10
            assert outputs["n_kept"][0] == n_keep


def test_where_a_partial_system_stands_still_in_a_mode_twelve_digits_are_left_or_the_cell_says_so():
    """Equal masses and springs, free: mass 4 rests in a mode of its own partial frequency."""
    n = 8
    chain = {"J": np.ones(n), "k": np.append(np.ones(n - 1), 0.0), "h": np.zeros(n)}
    truth = frequencies(chain["J"], chain["k"], 60)
    for n_keep in range(1, n) if COMPILED else (1,):
        for rtol in (1e-9, 1e-11, 1e-12, 1e-13, 1e-16):
            outputs, status = reduced("exact", chain, rtol, n_keep=n_keep)
            error = relative_error(outputs["frequency"][0, 1:], truth[1:]).max()
            assert error < 1e-11
            assert status[0] == Status.OK if rtol == 1e-9 else error <= rtol or status[0] == Status.INACCURATE
    assert status[0] == Status.INACCURATE


def test_a_chain_of_its_full_size_is_itself():
    for reduction in ("none", *REDUCING) if COMPILED else ("none", "irs"):
        outputs, _ = reduced(reduction, n_keep=8, f_max=300.0)
        assert outputs["n_kept"][0] == 8
        assert abs(outputs["frequency_error"][0]).max() < 1e-13, reduction
        assert outputs["frf_error"][0] < 1e-12, reduction
    assert outputs["valid_to"][0] == 300.0


def test_the_sources_order_takes_out_the_masses_3_2_and_5():
    """As in its Tables 2 to 4."""
    steps = [("a", 2), ("a", 1), ("a", 2)]
    for count in (1, 2, 3):
        outputs, _ = reduced("rivin", order="paper", n_keep=8 - count)
        truth = oracles.rivin(*FULA.values(), steps[:count])
        for name, values in zip(("J_kept", "k_kept", "h_kept"), truth, strict=True):
            assert relative_error(outputs[name][0, : 8 - count], values).max() < 2e-14, name


def test_merging_the_motor_spring_holds_to_one_and_a_half_hertz():
    outputs, status = reduced("rivin", n_keep=2, f_max=1.4)
    assert outputs["k_kept"][0, 1] != FULA["k"][7]
    assert outputs["valid_to"][0] == pytest.approx(0.1 / (2 * np.pi) / (13.0 / 1192), rel=1e-12, abs=0.0)
    assert status[0] == Status.OK
    assert reduced("rivin", n_keep=2, f_max=1.6)[1][0] == Status.DAMPERS_OUT_OF_RANGE
    assert reduced("guyan", n_keep=2, f_max=1e3)[1][0] == Status.DAMPERS_OUT_OF_RANGE


@pytest.mark.parametrize("tol", [1e-1, 1e-2, 1e-4] if COMPILED else [0.01])
@pytest.mark.parametrize("reduction", REDUCING if COMPILED else ("rivin", "modal"))
def test_the_fewest_masses_hold_the_tolerance_and_one_less_does_not(reduction, tol):
    f_max = 150.0
    outputs, _ = reduced(reduction, tol=tol, f_max=f_max)
    kept = int(outputs["n_kept"][0])
    inside = outputs["frequency"][0] / (1 + outputs["frequency_error"][0]) <= f_max
    assert inside.sum() >= 4 or kept == 1
    assert abs(outputs["frequency_error"][0, :4]).max() <= tol
    if reduction == "exact":
        assert kept == 1
    else:
        less = reduced(reduction, n_keep=kept - 1)[0]["frequency_error"][0, :4]
        assert kept == 4 or abs(less).max() > tol
    if reduction == "modal":
        assert kept == 4


def test_a_band_that_ends_at_a_frequency_and_systems_that_tie_are_told_alike_in_any_units():
    """In units of 0.1 and 0.3 the third frequency, and J e that are equal, are another number in their last digit."""
    whole = {"J": np.array([1.0, 1.0, 2.0, 3.0, 2.0]), "k": np.array([2.0, 3.0, 2.0, 2.0, 3.0]), "h": np.zeros(5)}
    scaled = {"J": 0.1 * whole["J"], "k": 0.3 * whole["k"], "h": np.zeros(5)}
    one, other = (reduced("rivin", chain, n_keep=1)[0]["J_kept"][0, 0] for chain in (whole, scaled))
    assert other == pytest.approx(0.1 * one, rel=1e-13)
    with oracles.mp.workdps(50):
        third = float(frequencies(scaled["J"], scaled["k"])[2])
    for f_max in third * (1 + np.array([-3e-16, 0.0, 3e-16])):
        assert reduced("modal", scaled, tol=1e-6, f_max=f_max)[0]["n_kept"][0] == 3


@pytest.mark.parametrize("reduction", ["none", *REDUCING] if COMPILED else ["rivin", "irs", "craig_bampton"])
def test_a_chain_with_free_ends_keeps_its_free_motion(reduction):
    chain = FULA | {"k": np.append(FULA["k"][:-1], 0.0)}
    outputs, _ = reduced(reduction, chain, n_keep=5, f_max=100.0)
    assert outputs["frequency"][0, 0] == 0
    assert outputs["frequency_error"][0, 0] == 0
    assert np.isnan(outputs["frf_error"][0]) or reduction == "none"
    if reduction in ("guyan", "irs", "craig_bampton"):
        with oracles.mp.workdps(50):
            expected = oracles.Reduced(reduction, *chain.values(), 5, [0, 3, 5, 6, 7]).frequencies()[1:]
        assert relative_error(outputs["frequency"][0, 1:5], expected).max() < 1e-12


@pytest.mark.parametrize(
    "cell",
    [
        {"k": (0.0, 1.0)}, {"J": np.ones(65), "k": np.ones(65)}, {"reduction": 1.0},
        {"reduction": 1.0, "n_keep": 3.0}, {"reduction": 1.0, "n_keep": 1.0, "tol": 0.1},
    ],
)  # fmt: skip
def test_a_chain_with_a_gap_and_a_reduction_without_its_size_or_with_two_are_bad_input(cell):
    J, k = (np.atleast_2d(cell.pop(name, (1.0, 2.0))) for name in "Jk")
    assert checked(DRIVETRAIN, J, k, **cell)[0] == Status.BAD_INPUT
    assert checked(DRIVETRAIN, [[1.0, 2.0]], [[1.0, 0.0]], reduction=1.0, n_keep=1.0)[0] == Status.OK


def test_a_result_that_no_float64_can_hold_is_left_out():
    huge = {"J": np.full(3, 1.7e308), "k": np.ones(3), "h": np.zeros(3)}
    outputs, status = reduced("rivin", huge, n_keep=1)
    assert status[0] == Status.PARTLY_OUT_OF_RANGE
    assert np.isnan(outputs["J_kept"][0, 0])  # the sum of the inertias
    small, _ = reduced("rivin", huge | {"J": np.full(3, 1.7)}, n_keep=1)
    for name, scale in (("frequency", 10.0**-154), ("k_kept", 1.0), ("damping", 1.0)):
        np.testing.assert_allclose(outputs[name][0, 0], small[name][0, 0] * scale, rtol=1e-13)
