"""Which parameters decide a foliot's rate?

    python studies/rate_parameters.py rate_parameters.h5

Compares Sobol' indices of torque, friction, switching angle and restitution on ln(period), by SALib, with what the
exponents say: P = F(alpha)/a with alpha = mu/(a^2 phi0), so with s = -d ln P/d ln mu they are -s for mu, s for phi0 and
2 s - 1 for a. Where all are known equally well, the shares of the variance are their squares over the sum of these.

Friction decides nothing where the period falls as mu^(-1/2): more of it lowers the speed and the amplitude alike.
"""

import numpy as np
import xarray as xr
from _common import Claims, differing, script
from _figures import COLOURS, DRIVE, MARKS, Axis, direct_label, page, panel
from _losses import of_quarter, quarter

import sweep

DRIVES = np.geomspace(1e-2, 1e4, 25)
NAMES = {"mu": "torque", "a": "friction", "phi0": "switching angle", "e": "restitution"}


def shares(drive: float) -> dict[str, float]:
    """Shares of the variance of ln(P) by torque, friction and angle, from the exponent of the torque at a drive."""
    _, s, _ = of_quarter(quarter(drive))
    squares = {"mu": s**2, "a": (2 * s - 1) ** 2, "phi0": s**2}
    return {name: square / sum(squares.values()) for name, square in squares.items()}


def prepared(ds):
    """The result, and the indices of every parameter along the drive, for a = phi0 = 1."""
    found, design = [], {"kind": "saltelli", "n": 128, "seed": 1}
    for drive in DRIVES:
        middles = {"mu": drive, "a": 1.0, "phi0": 1.0}
        axes = {name: {"spacing": "log", "start": 0.9048 * x, "stop": 1.1052 * x} for name, x in middles.items()}
        axes["e"] = {"spacing": "linear", "start": 0.99, "stop": 1.0}
        made = sweep.run(kernel="foliot", rtol=1e-10, outputs=["period"], design=design, axes=axes)
        found.append(sweep.sensitivity(made, np.log(made.period)))
    return ds, xr.concat(found, dim=xr.DataArray(DRIVES, dims="alpha", name="alpha"))


def claims(ds, _) -> Claims:
    yield f"Sobol' index, total, alpha = {ds.mu.min():.3g} to {ds.mu.max():.3g}"
    total = sweep.sensitivity(ds, np.log(ds.period)).total.to_series()
    for name, share in shares(float(np.sqrt(ds.mu.min() * ds.mu.max()))).items():
        # what 1024 points and a curve over 10 % leave
        yield differing(NAMES[name], f"{share:.4f}", total[name] / (1 - total["e"]), share, 0.03)


@panel(DRIVE, Axis(r"share of the variance of $\ln P$ [1]", (-0.02, 0.58)))
@page(82.0, 120.0)
def figure(axes, _, found):
    """Total indices against the drive, with the shares that the exponents give."""
    law = [shares(drive) for drive in found.alpha.values]
    labels = {"mu": (0.1, 0.44, "torque"), "phi0": (22.0, 0.48, "switching angle, alike")}
    labels |= {"a": (25.0, 0.13, "friction"), "e": (250.0, 0.09, "restitution")}
    for k, (name, (x, y, text)) in enumerate(labels.items()):
        some = found.isel(alpha=slice(k % 2 if name in ("mu", "phi0") else 0, None, 2 if k < 2 else 1))
        axes.plot(some.alpha, some.total.sel(parameter=name), MARKS[k], color=COLOURS[k], label=text)
        if name in law[0]:
            axes.plot(found.alpha, [row[name] for row in law], "-", color=COLOURS[k], zorder=0, linewidth=0.8)
        direct_label(axes, x, y, text, COLOURS[k])


main = script(__name__, "rate_parameters.h5", claims, figure, prepared)
