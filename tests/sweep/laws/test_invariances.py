"""What no fit of a law may depend on: units, order of points and of sets, missing points; and truths found to rounding.

Lines of random numbers, most with a bend or with scatter, are fitted as they are and changed in a way that changes the
result in a way that is known.
"""

import numpy as np
import pytest
import xarray as xr

import sweep

SETS = 3


def curves(kind, seed):
    """Lines along x, a set of them along "size"; y > 0."""
    rng = np.random.default_rng(seed)
    t = np.sort(np.linspace(0.0, 9.0, 40) + rng.uniform(-0.05, 0.05, 40))
    low, bend, power = rng.uniform(-2.0, 2.0, (3, SETS, 1))
    z = {
        "exact": low * t + bend,
        "bent": low * t - (1.0 + abs(power)) * np.logaddexp(0.0, 1.5 * (t - 4.5 - 0.5 * bend)),
        "tends": low * t + np.log1p(np.exp(bend - 0.7 * t)),
        "scatters": low * t + bend + 0.02 * rng.standard_normal((SETS, t.size)),
    }[kind.removesuffix(", scatters")] + 1e-3 * kind.endswith(", scatters") * rng.standard_normal((SETS, t.size))
    return xr.DataArray(np.exp(z), {"size": np.arange(1.0, SETS + 1), "x": np.exp(t)}, ("size", "x"), name="y")


def sigma_of(y):
    return 0.02 * y * (1.0 + np.log(y.x / y.x.min()) / 4.5)


FITS = {
    "line": (lambda y: sweep.fit_exponent(y, "x", noise="uneven"), "scatters"),
    "line of noise found": (lambda y: sweep.fit_exponent(y, "x"), "scatters"),
    "line with sigma": (lambda y: sweep.fit_exponent(y, "x", sigma=sigma_of(y)), "scatters"),
    "bent line": (lambda y: sweep.fit_exponent(y, "x"), "bent"),
    "two laws": (lambda y: sweep.fit_two_laws(y, "x"), "bent, scatters"),
    "two windows": (lambda y: in_two_windows(y), "bent, scatters"),
    "correction": (lambda y: sweep.fit_correction(y, "x"), "tends"),
    "local exponent": (lambda y: sweep.local_exponent(y, "x", error=True), "bent"),
    "where exponent": (lambda y: crossing(y), "bent"),
    "comparison": (lambda y: sweep.compare_laws(y.isel(size=0), "x").isel(law=0), "tends, scatters"),
}
"""Each with the kind of lines that it is of."""


def in_two_windows(y):
    low, high = float(y.x.min()), float(y.x.max())
    return sweep.fit_two_laws(y, "x", windows=((low, low * 10), (high / 10, high)))


def crossing(y):
    """Where the local exponent is half-way between those at the ends."""
    local = sweep.local_exponent(y, "x")
    middle = 0.5 * (local.isel(x=0) + local.isel(x=-1))
    each = [sweep.where_exponent(y.isel(size=k), "x", float(middle[k])) for k in range(y.sizes["size"])]
    return xr.concat([found.drop_attrs() for found in each], "size")


IN_X = (
    "crossover", "crossover_low", "crossover_high", "crossover_error", "abscissa", "abscissa_error", "low", "high",
    "centre", "x",
)  # fmt: skip
IN_Y = ("level", "start", "stop", "y", "fitted")
OF_BOTH = ("prefactor", "prefactor_error")
"""Numbers that change with the units; all others do not."""


def compared(found, expected, rtol):
    """Whether all numbers that are there agree; words do not count."""
    for name in expected.data_vars:
        if name in OF_BOTH or expected[name].dtype.kind not in "fi":
            continue
        one, other = (
            found[name].transpose(*expected[name].dims).values.astype(float),
            expected[name].values.astype(float),
        )
        np.testing.assert_array_equal(np.isnan(one), np.isnan(other), err_msg=str(name))
        scale = np.where(np.isfinite(other), np.maximum(abs(other), 1.0), 1.0)
        np.testing.assert_allclose(one / scale, other / scale, rtol=0, atol=rtol, err_msg=str(name))


def rescaled(found, x=1.0, y=1.0):
    """What was found of lines whose x and y are so many times larger, in the units of the others."""
    units = dict.fromkeys(IN_X, x) | dict.fromkeys(IN_Y, y)
    return found.assign({name: found[name] / units[name] for name in found.data_vars if name in units})


@pytest.mark.parametrize("name", FITS)
@pytest.mark.parametrize("seed", [1, 2])
def test_units_order_and_missing_points_change_nothing(name, seed):
    fit, kind = FITS[name]
    y = curves(kind, seed)
    found = fit(y)
    compared(rescaled(fit(y.assign_coords(x=1024.0 * y.x)), x=1024.0), found, 1e-4)
    compared(rescaled(fit(1e-3 * y), y=1e-3), found, 1e-4)
    turned = fit(y[:, ::-1])
    compared(turned.sortby("x") if "x" in turned.dims else turned, found, 1e-4)
    if "size" in found.dims:
        compared(fit(y[::-1]).sortby("size"), found, 1e-9)
        compared(fit(y.transpose("x", "size")), found, 1e-9)
        compared(fit(y.isel(size=[1])), found.isel(size=[1]), 1e-9)
    holed = y.copy()
    holed[:, [5, 7, 8, 30]] = np.nan
    if "x" not in found.dims and name != "where exponent":
        compared(fit(holed), fit(y.isel(x=[k for k in range(40) if k not in (5, 7, 8, 30)])), 1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_laws_that_lines_are_made_of_are_found_to_rounding(seed):
    rng = np.random.default_rng(seed)
    x = np.geomspace(*sorted(10.0 ** rng.uniform(-9.0, 9.0, 2) * [1.0, 1e3]), 61)
    power, factor, middle = rng.uniform(-3.0, 3.0), 10.0 ** rng.uniform(-50, 50), np.sqrt(x[0] * x[-1])
    line = xr.DataArray(factor * x**power, {"x": x}, "x", name="y")
    found = sweep.fit_exponent(line, "x")
    assert float(found.exponent) == pytest.approx(power, abs=1e-13)
    assert float(found.exponent_low) <= power <= float(found.exponent_high)
    assert float(found.level) == pytest.approx(factor * float(found.centre) ** power, rel=1e-12, abs=0.0)
    assert float(found.prefactor) == pytest.approx(factor, rel=1e-11, abs=0.0)
    assert sweep.compare_laws(line, "x").attrs["chosen"] == "one law"
    np.testing.assert_allclose(sweep.local_exponent(line, "x"), power, rtol=0, atol=1e-9)
    span = np.log(x[-1] / x[0])
    # ln y = power ln x + b ln^2(x/middle): the local exponent is a straight line, which differences of any order find
    b = rng.choice([-0.7, 0.7]) / span
    parabola = line * np.exp(b * np.log(line.x / middle) ** 2)
    local = power + 2 * b * np.log(x / middle)
    np.testing.assert_allclose(sweep.local_exponent(parabola, "x"), local, rtol=0, atol=1e-9)
    place = sweep.where_exponent(parabola, "x", power + 0.3)
    assert np.log(float(place.abscissa) / middle) == pytest.approx(0.15 / b, rel=1e-8)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_collapse_does_not_depend_on_units_or_order(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-2.0, 2.0, 2)
    x, size = np.geomspace(0.01, 100.0, 25), np.array([1.0, 2.0, 4.0, 8.0])
    u = x / size[:, None] ** a
    y = xr.DataArray(size[:, None] ** b / (u + u**0.2), {"L": size, "x": x}, ("L", "x"), name="y")

    def fit(y):
        found = sweep.fit_collapse(y, "x", "L")
        return [float(found.x_exponent), float(found.y_exponent)]

    found = fit(y)
    assert found == pytest.approx([a, b], abs=1e-4)
    changed = [1e3 * y, y.assign_coords(x=1e-3 * x), y.assign_coords(L=8 * size), y[::-1], y[:, ::-1], y.T]
    for other in changed:
        assert fit(other) == pytest.approx(found, abs=1e-4)
    holed = y.copy()
    holed[1, 3] = np.nan
    assert fit(holed) == pytest.approx([a, b], abs=1e-4)
