"""What does a measured period say of a clock's friction, and how surely?

    python studies/fit_a_model.py

A worked example of fits with the libraries of the field: a power law by xarray's `curvefit`, and the kernel itself, by
`sweep.solver`, as a model of lmfit, with intervals of both parameters.
"""

from typing import Any

import lmfit
import numpy as np
import xarray as xr

import sweep

KEYS = {"kernel": "foliot", "outputs": ["period"], "rtol": 1e-10}
TRUE = {"a": 0.8, "phi0": 0.7}
"""The clock that is measured: 1/s and rad."""
NOISE = 1e-3
"""Relative, of each of its periods."""
MU = np.geomspace(0.1, 100.0, 25)
"""Torques at which it is measured [rad/s^2]."""


def measured(seed: int = 0) -> xr.DataArray:
    """Periods of the clock [s], as a stop watch tells them."""
    period = sweep.run(**KEYS, axes={"mu": MU}, fixed=TRUE).period
    return period * (1 + NOISE * np.random.default_rng(seed).standard_normal(period.shape))


def power_law(period: xr.DataArray, lowest: float) -> xr.Dataset:
    """Prefactor and exponent of P = c mu^p above a torque, by `DataArray.curvefit`."""
    high = period.where(period.mu > lowest, drop=True)
    return high.curvefit("mu", lambda mu, c, p: c * mu**p, p0={"c": 1.0, "p": -0.4})


def fitted(period: xr.DataArray) -> Any:
    """Friction and switching angle of the clock, by least squares of relative deviations."""
    clock = sweep.solver({**KEYS, "axes": {"mu": [1.0], "a": [1.0], "phi0": [1.0]}})
    model = lmfit.Model(lambda mu, a, phi0: np.log(clock(mu, a, phi0).period))
    start = {"a": {"value": 1.0, "min": 1e-3}, "phi0": {"value": 1.0, "min": 1e-3, "max": 3.0}}
    return model.fit(np.log(period.values), model.make_params(**start), mu=period.mu.values)


if __name__ == "__main__":
    periods = measured()
    print(power_law(periods, 10.0).curvefit_coefficients.to_series().to_string())
    print(fitted(periods).fit_report())
