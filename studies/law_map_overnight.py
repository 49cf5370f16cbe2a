"""At which torque is a foliot with four losses the steadiest, and along which borders do its laws meet?

    sweep refine law_map_borders.h5 --y sensitivity --tolerance 0.02 -o law_map_borders_fine.h5
    python studies/law_map_overnight.py law_map_overnight.h5 law_map_borders_fine.h5

About 1e8 clocks and torques. At large swings the speed v at the switch follows from the energy of half a swing,

    2 mu phi0 = R v^2/mu + 2 a v^3/(3 mu) + 2 c v^(n+2)/((n+2) mu) + (1 - e^2) v^2/2,                    (1)

and s = -dlnP/dlnmu from the shares of its terms, (N + lambda_e)/(N + 2) as in `law_map`, to which dry friction adds
lambda_dry/((mu/R)^2 - 1) since it helps to brake what the torque drives. More torque makes the second less and the
first more: between them lies the best torque. With light viscous friction and none other it is
mu = R (18 R/(a^2 phi0))^(1/6), and

    s = 3 (18 R/(a^2 phi0))^(-1/3).                                                                      (2)

Equation (1) is solved for every third R and every fourth c; a step of the torque is 12 %.
"""

import math
from typing import Any

import numpy as np
import xarray as xr
from _common import Claims, compared, count, differing, most, power, said, script, solved
from _figures import COLOURS, TORQUE, Log, S, colour_map, direct_label, page, panel, points
from scipy.optimize.elementwise import find_root

import sweep

LARGE = 5.0
"""Way beyond the switch over phi0, by (1), from which (1) is held to 0.01 of s."""


def balanced(clocks: xr.Dataset, mu: xr.DataArray) -> xr.Dataset:
    """By (1), for each clock: the least `s`, its torque `mu`, and the way beyond the switch over phi0 there."""
    a, phi0 = float(clocks.a), float(clocks.phi0)

    def losses(v, n, e, R, c, mu) -> tuple[Any, ...]:
        drag = 2 * c * v ** (n + 2) / ((n + 2) * mu)
        return R * v**2 / mu, 2 * a * v**3 / (3 * mu), drag, 0.5 * (1 - e**2) * v**2

    def unpaid(log_v, *terms):
        return sum(losses(np.exp(log_v), *terms)) - 2 * terms[-1] * phi0

    terms = xr.broadcast(*(clocks[name] for name in ("n", "e", "R", "c")), mu)
    found = find_root(unpaid, (math.log(1e-6), math.log(1e10)), args=tuple(x.values for x in terms))
    v = terms[0].copy(data=np.exp(found.x))
    n, _, R, _, mu = terms
    dry, viscous, drag, struck = (x / (2 * mu * phi0) for x in losses(v, *terms))
    N = viscous + n * drag
    s = ((N + struck) / (N + 2) + dry / ((mu / R) ** 2 - 1)).where(mu > R, math.inf)
    beyond = v**2 / (2 * mu * phi0)
    return xr.Dataset({"s": s, "mu": mu.drop_vars("mu"), "beyond": beyond}).isel(mu=s.argmin("mu"))


def claims(ds, fine) -> Claims:
    yield "The best torque"
    some = {name: slice(None, None, k) for name, k in (("R", 3), ("c", 4)) if ds.sizes[name] > 40}
    clocks = ds[["sensitivity_min", "sensitivity_argmin_mu"]].isel(some).load()
    theory = balanced(clocks, ds.mu)
    far, step = theory.beyond > LARGE, float(np.diff(np.log(ds.mu)).mean())
    steps = (abs(np.log(clocks.sensitivity_argmin_mu / theory.mu)).where(far) / step).max()
    least, place = ds.sensitivity_min.load(), ds.sensitivity_argmin_mu.load()
    inside = float(((place > ds.mu[0]) & (place < ds.mu[-1])).mean())
    line = least.sel(e=1).isel(n=0, c=0)
    high = line.where(line.R > 1e3, drop=True)
    limit, light = 3 * (18 * float(high.R[-1])) ** (-1 / 3), f"light viscous friction, R = {high.R[-1]:g}: least s"
    beyond, missed = f"least s by (1), {LARGE:g} phi0 beyond the switch", f"{1 - inside:.0%} of {least.size}"
    yield most(beyond, "s", (clocks.sensitivity_min - theory.s).where(far), 0.01, count(far, "clocks"))
    yield said("  the torque where it is", steps < 2.5, f"within {steps:.0f} steps", "(1)")
    yield compared(light, f"(2) {limit:.4f}", high[-1], limit, 0.08)
    yield differing("  its power of R, R > 1000", "-1/3", power(high), -1 / 3, 0.06)
    yield said("strong drive is best (paper, of viscous friction)", inside < 0.01, missed, "every clock", True)

    yield "Along the borders"
    # s between the cells of the refinement, against the kernel there
    random, at = np.random.default_rng(1), {}
    for name in ("c", "mu"):
        ends = np.log([float(fine[name].min()), float(fine[name].max())])
        at[name] = np.sort(np.exp(random.uniform(*ends, 45)))
    here, clock = sweep.interpolated(fine, at).sensitivity, {name: fine[name] for name in ("a", "e", "n", "phi0")}
    true = solved("foliot", **at, **clock, rtol=1e-8, outputs=["sensitivity"]).sensitivity.transpose(*here.dims)
    near = np.mean([(abs(fine.sensitivity - law) > 0.01) for law in (1, 1 / 3, 1 / 2, 3 / 5)], axis=0) == 1
    what = f"s between {fine.sensitivity.size} cells, {here.size} places"
    yield most(what, "2 %", here / true.values - 1, 0.02, "largest error")
    yield said("  farther than 0.01 from 1, 1/3, 1/2 and 3/5", near.mean() > 0.5, f"{near.mean():.0%}", "most cells")


KEY = {"(2)": {"linewidth": 0.8, "linestyle": ":"}, "(1)": "-"}
DRY, LEAST = Log(r"dry friction, $R/(a^2\varphi_0)$ [1]"), Log("least $s$ [1]", (0.04, 0.7), (0.05, 0.1, 0.2, 0.5))


@panel(DRY, LEAST, "lower left", KEY)
@panel(TORQUE, Log(r"drag, $c\,a\varphi_0^2$ [1]"))
@page(138.0)
def figure(least, borders, ds, fine):
    """The least s over dry friction with hardly any drag, with (1) and (2), and the refined borders."""
    part = ds[["sensitivity_min"]].isel(c=[0]).sel(n=[3.0]).isel(R=slice(None, None, 3)).load()
    part = part.where(part.R > 1, drop=True)
    theory = balanced(part, ds.mu)
    for k, e in enumerate((1.0, 0.99, 0.9, 0.5)):
        here, line = (x.sel(e=e, method="nearest").isel(n=0, c=0) for x in (part.sensitivity_min, theory))
        points(least, here.R, here, k, f"$e={e:g}$", markersize=3)
        least.plot(line.R, line.s.where(line.beyond > LARGE), color=COLOURS[k])
    R = np.geomspace(10, 1e4, 20)
    least.plot(R, 3 * (18 * R) ** (-1 / 3), color="black", linewidth=0.8, linestyle=":")

    at = {name: np.geomspace(float(fine[name].min()), float(fine[name].max()), 120) for name in ("c", "mu")}
    s = sweep.interpolated(fine, at).sensitivity.transpose("c", "mu")
    colour_map(borders, s.mu, s.c, s, S.label, vmin=1 / 3, vmax=1)
    borders.plot(fine.mu.values.ravel(), fine.c.values.ravel(), ".", color="white", markersize=1.2)
    for x, y, text in ((3e-2, 1e-6, "1"), (3e2, 1e-6, "1/3"), (1e6, 3e-6, "3/5"), (1e6, 1e-1, "1/3, drag")):
        direct_label(borders, x, y, text)


main = script(__name__, "law_map_overnight.h5 law_map_borders_fine.h5", claims, figure)
