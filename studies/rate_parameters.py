"""Which parameters decide a foliot's rate?

    python studies/rate_parameters.py rate_parameters.h5

compares Sobol' indices and Morris' effects of torque, friction, switching angle and restitution on ln(period), by SALib
on designs of ours, with what the exponents say, and draws the indices against the drive: rate_parameters.png.

P = F(alpha)/a with alpha = mu/(a^2 phi0), so with s = -d ln P/d ln mu the exponents are -s for mu, s for phi0 and
2 s - 1 for a. Where all are known equally well, the shares of the variance are their squares over the sum of these.
"""

from typing import Any

import numpy as np
import xarray as xr
from _common import Conclusion, Groups, differing, read_result, script
from _figures import direct_label, page_of

import sweep
from sweep.show.charts import COLOURS, MARKS

TOML = "studies/rate_parameters.toml"
ALLOWED = 0.03
"""Of a share: what 1024 points and a curve over 10 % leave."""
DRIVES = np.geomspace(1e-2, 1e4, 25)
RANGES = {name: {"spacing": "log", "start": 0.9048, "stop": 1.1052} for name in ("mu", "a", "phi0")}
KEPT = {"e": {"spacing": "linear", "start": 0.99, "stop": 1.0}}
POINTS = 128
NAMES = {"mu": "torque", "a": "friction", "phi0": "switching angle", "e": "restitution"}

NOTES = """\
Friction decides nothing where the period falls as mu^(-1/2): more of it lowers the speed and the amplitude alike, so
that a shorter way is gone more slowly in the same time. Who wants a steady rate there looks after the torque and the
pallets, not after the oil."""


def shares(s: float) -> dict[str, float]:
    """Shares of the variance of ln(P) by torque, friction and angle, from the exponent of the torque."""
    squares = {"mu": s**2, "a": (2 * s - 1) ** 2, "phi0": s**2}
    return {name: square / sum(squares.values()) for name, square in squares.items()}


def sampled(drive: float, kind: str, n: int) -> xr.Dataset:
    """Cells of a design around a drive alpha, for a = phi0 = 1."""
    torque = {**RANGES["mu"], "start": 0.9048 * drive, "stop": 1.1052 * drive}
    axes = {**RANGES, "mu": torque, **KEPT}
    design = {"kind": kind, "n": n, "seed": 1}
    return sweep.run(kernel="foliot", rtol=1e-10, outputs=["period"], design=design, axes=axes)


def exponent(drive: float) -> float:
    """s of the viscous foliot at a drive alpha."""
    viscous = {"kernel": "foliot", "outputs": ["sensitivity"], "fixed": {"a": 1.0, "phi0": 1.0}}
    clock = sweep.solver({**viscous, "axes": {"mu": [1.0]}})
    return float(clock(drive).sensitivity)


def against_drive(drives: Any = DRIVES) -> xr.Dataset:
    """Indices of every parameter along the drive."""
    found = []
    for drive in drives:
        ds = sampled(float(drive), "saltelli", POINTS)
        found.append(sweep.sensitivity(ds, np.log(ds.period)))
    return xr.concat(found, dim=xr.DataArray(drives, dims="alpha", name="alpha"))


def statements(ds: xr.Dataset) -> Groups:
    """What the indices are beside what the exponents say."""
    drive = float(np.sqrt(ds.mu.min() * ds.mu.max()))
    sobol = sweep.sensitivity(ds, np.log(ds.period)).total.to_series()
    cells = sampled(drive, "morris", 64)
    morris = sweep.sensitivity(cells, np.log(cells.period)).effect.to_series()
    s, width = exponent(drive), float(np.log(1.1052 / 0.9048))
    theory = shares(s)
    effects = {"mu": s * width, "a": abs(2 * s - 1) * width, "phi0": s * width}
    rest = 1 - float(sobol["e"])
    return {
        f"Sobol' index, total, at alpha = {drive:.3g}": [
            differing(NAMES[name], f"{share:.4f}", float(sobol[name]) / rest, share, ALLOWED, 4)
            for name, share in theory.items()
        ],
        "Morris' effect on ln(P), over the range": [
            differing(NAMES[name], f"{effect:.4f}", float(morris[name]), effect, 0.01, 4)
            for name, effect in effects.items()
        ],
    }


def figure(found: xr.Dataset) -> Any:
    """Total indices against the drive, with the shares that the exponents give."""
    with page_of(82.0, width=120.0) as (page, axes):
        law = [shares(exponent(float(drive))) for drive in found.alpha.values]
        labels = {"mu": (0.1, 0.44, "torque"), "phi0": (22.0, 0.48, "switching angle, alike")}
        labels |= {"a": (25.0, 0.13, "friction"), "e": (250.0, 0.09, "restitution")}
        for k, (name, (x, y, text)) in enumerate(labels.items()):
            some = found.isel(alpha=slice(k % 2 if name in ("mu", "phi0") else 0, None, 2 if k < 2 else 1))
            axes.plot(some.alpha, some.total.sel(parameter=name), MARKS[k], color=COLOURS[k], label=text)
            if name in law[0]:
                axes.plot(found.alpha, [row[name] for row in law], "-", color=COLOURS[k], zorder=0, linewidth=0.8)
            direct_label(axes, x, y, text, COLOURS[k])
        axes.set(xscale="log", ylim=(-0.02, 0.58), ylabel=r"share of the variance of $\ln P$ [1]")
        axes.set_xlabel(r"drive, $\alpha = \mu/(a^2 \varphi_0)$ [1]")
    return page


def conclude(path: str) -> Conclusion:
    """Table, notes and figure of a result."""
    ds = read_result(path, "foliot", ["cell"], TOML)
    return statements(ds), [NOTES], lambda: figure(against_drive())


main = script(__name__, "rate_parameters.h5", conclude)
