"""Fits of laws end in numbers, NaN or a refusal that names what is wrong, whatever finite or missing data they get.

Lines of every kind are drawn at random, since what ends a fit from within is rare: two in 300 of plain power laws.
"""

import numpy as np
import pytest
import xarray as xr

import sweep

KINDS = ("exact", "noisy", "lognormal", "constant", "outlier", "step", "bent", "loud ends", "rounded")
FITS = {
    "exponent": (lambda y, sigma: sweep.fit_exponent(y, "speed", sigma=sigma), 40),
    "two laws": (lambda y, sigma: sweep.fit_two_laws(y, "speed"), 8),
    "correction": (lambda y, sigma: sweep.fit_correction(y, "speed"), 30),
}
"""Each with as many sets of lines as are drawn for it."""


def line(rng, t, kind):
    """ln y at ln x = t, of any kind and size."""
    n, s = t.size, np.linspace(0.0, 1.0, t.size)
    straight, noise = rng.choice([0.0, -1.0, 0.5, 1e-12]) * (t - t[0]), rng.standard_normal(n)
    return (
        rng.choice([0.0, 0.0, 650.0, -650.0])
        + {
            "exact": straight,
            "noisy": straight + rng.choice([1e-14, 0.02, 1.0]) * noise,
            "lognormal": -rng.choice([1.0, 10.0, 100.0]) * (s - rng.random()) ** 2 + rng.choice([0.0, 0.02]) * noise,
            "constant": 0.0 * t,
            "outlier": straight + np.where(np.arange(n) == rng.integers(n), rng.choice([5.0, 1300.0]), 0.0),
            "step": (s > 0.5) * rng.choice([1e-10, 1.0, 500.0]),
            "bent": -0.5 * np.logaddexp(0.0, 20 * (s - 0.5)) + rng.choice([0.0, 0.01]) * noise,
            "loud ends": straight + 0.05 * noise * np.where(abs(s - 0.5) > 0.3, 25.0, 1.0),
            "rounded": np.log(np.round(np.exp(np.clip(straight, -5.0, 5.0)), 2) + 0.01),
        }[str(kind)]
    )


def lines(seed):
    """Up to three lines of as many kinds, some points of which are missing, and perhaps standard errors likewise."""
    rng = np.random.default_rng(seed)
    n = int(rng.choice([2, 3, 8, 9, 12, 25, 40]))
    start = rng.choice([0.0, -290.0, 150.0, 3.0])
    t = np.log(10) * np.linspace(start, start + rng.choice([0.01, 1.0, 4.0, 12.0, 140.0]), n)
    y = np.exp(np.clip([line(rng, t, kind) for kind in rng.choice(KINDS, rng.integers(1, 4))], -700.0, 700.0))
    y[rng.random(y.shape) < rng.choice([0.0, 0.0, 0.1, 0.5])] = np.nan
    if rng.random() < 0.1:
        y[0, rng.integers(n)] = rng.choice([np.inf, 0.0, -1.0])
    order = rng.choice([1, -1])
    y = xr.DataArray(y, {"size": np.arange(1.0, len(y) + 1), "speed": np.exp(t)}, ("size", "speed"), name="torque")
    sigma = abs(y.fillna(1.0)) * rng.choice([1e-10, 0.02]) * np.exp(rng.choice([0.0, 5.0]) * rng.random(y.shape))
    sigma = sigma.where((rng.random(y.shape) > rng.choice([0.0, 0.3])) & np.isfinite(sigma) & (sigma > 0))
    return y[:, ::order], None if rng.random() < 0.5 else sigma[:, ::order]


def found(fit, *given):
    """What a fit gives, None where it refuses."""
    try:
        return fit(*given)
    except (sweep.SweepError, ValueError) as error:
        message = str(error)
    assert any(word in message for word in ("torque", "speed", "size", "sigma", "curve")), message
    return None


def part(sigma, k):
    return None if sigma is None else sigma.isel(size=k)


@pytest.mark.parametrize("name", FITS)
def test_lines_of_any_data_are_fitted_or_refused_and_none_has_to_do_with_others(name):
    fit, sets = FITS[name]
    for seed in range(sets):
        y, sigma = lines(seed)
        group = found(fit, y, sigma)
        if group is None:
            continue
        known = group.exponent.notnull()
        held = (group.exponent_low <= group.exponent) & (group.exponent <= group.exponent_high)
        assert bool(held.where(known, True).all()), seed
        for k in range(y.sizes["size"]):
            alone = found(fit, y.isel(size=k), part(sigma, k))
            if alone is None:
                assert not known.isel(size=k).any(), seed
            else:
                xr.testing.assert_allclose(alone, group.isel(size=k), rtol=1e-7, atol=1e-9)


def test_laws_of_any_line_are_compared_or_refused():
    for seed in range(40):
        y, sigma = lines(seed)
        compared = found(lambda y, s: sweep.compare_laws(y, "speed", sigma=s), y.isel(size=-1), part(sigma, -1))
        assert compared is None or compared.attrs["chosen"] in compared.law


def test_curves_of_any_data_collapse_or_are_refused():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        size, t = 2.0 ** np.arange(rng.integers(2, 5)), np.linspace(-5.0, 5.0, rng.choice([8, 15, 25]))
        u = t - rng.choice([0.0, 1.5]) * np.log(size)[:, None]
        z = rng.choice([0.0, 0.02, 1.0]) * rng.standard_normal(u.shape)
        y = np.exp(z - rng.choice([0.0, 1.0]) * np.logaddexp(u, 0.2 * u) + rng.choice([0.0, 600.0, -600.0]))
        y[rng.random(y.shape) < rng.choice([0.0, 0.1, 0.6])] = rng.choice([np.nan, np.inf, 0.0, -1.0])
        curves = xr.DataArray(y, {"size": size, "speed": np.exp(t)}, ("size", "speed"), name="torque")
        fitted = found(lambda y: sweep.fit_collapse(y, "speed", "size"), curves)
        assert (
            fitted is None or not fitted.fits or fitted.x_exponent_low <= fitted.x_exponent <= fitted.x_exponent_high
        ), seed


# what is no output, no result and no study

X = np.geomspace(1, 100, 12)
LINE = xr.DataArray(X**-0.5, {"x": X}, "x", name="y")
OF_AN_OUTPUT = (
    lambda y: sweep.fit_exponent(y, "x"), lambda y: sweep.fit_two_laws(y, "x"), lambda y: sweep.fit_correction(y, "x"),
    lambda y: sweep.compare_laws(y, "x"),
    lambda y: sweep.local_exponent(y, "x", error=True), lambda y: sweep.where_exponent(y, "x", -0.5),
    lambda y: sweep.where_exponent(y, "x", 1.0, values=True),
    lambda y: sweep.fit_collapse(y, "x", "L"),
)  # fmt: skip


@pytest.mark.parametrize(
    "given", [3, None, "period", X, LINE.to_dataset(), [1.0], LINE.astype(str), LINE.astype(complex)]
)
def test_what_is_no_output_no_dataset_or_no_study_is_refused(given):
    for fit in OF_AN_OUTPUT:
        with pytest.raises(sweep.SweepError, match=r"one output|real numbers"):
            fit(given)
    if not isinstance(given, xr.Dataset):
        for use in (lambda ds: sweep.interpolated(ds, {"x": [1.0]}), lambda ds: sweep.refine(ds, "y", 0.1)):
            with pytest.raises(sweep.SweepError, match="expected a Dataset"):
                use(given)
    with pytest.raises(sweep.SweepError, match=r"study|no such file"):
        sweep.scaling(given)


@pytest.mark.parametrize("given", [np.ones(3), "no", LINE, None])
def test_what_is_neither_true_nor_false_is_refused(given):
    with pytest.raises(sweep.SweepError, match="values: expected True or False"):
        sweep.where_exponent(LINE, "x", -0.5, values=given)
    with pytest.raises(sweep.SweepError, match="error: expected True or False"):
        sweep.local_exponent(LINE, "x", error=given)


@pytest.mark.parametrize("sigma", [0.0, 1e-20, 1e9, LINE * 0])
def test_standard_errors_of_nothing_or_beyond_all_sense_are_refused(sigma):
    for fit in (sweep.fit_exponent, sweep.compare_laws):
        with pytest.raises(sweep.SweepError, match=r"sigma: .*standard errors"):
            fit(LINE, "x", sigma=sigma)
