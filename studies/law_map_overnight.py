"""At which torque is a foliot with four losses the steadiest, and along which borders do its laws meet?

    sweep run studies/law_map_overnight.toml
    sweep run studies/law_map_borders.toml
    sweep refine law_map_borders.h5 --y sensitivity --tolerance 0.02 -o law_map_borders_fine.h5
    python studies/law_map_overnight.py law_map_overnight.h5 law_map_borders_fine.h5

draws law_map_overnight.png and prints theory beside what comes out, of 1e8 clocks and torques. At large swings the
speed v at the switch follows from the energy of half a swing,

    2 mu phi0 = R v^2/mu + 2 a v^3/(3 mu) + 2 c v^(n+2)/((n+2) mu) + (1 - e^2) v^2/2,                    (1)

and the exponent from the shares of its terms, s = (N + lambda_e)/(N + 2) as in `law_map`, to which dry friction adds
lambda_dry/((mu/R)^2 - 1) since it helps to brake what the torque drives. More torque makes the second less and the
first more: between them lies the best torque. With light viscous friction and none other it is
mu = R (18 R/(a^2 phi0))^(1/6), and

    s = 3 (18 R/(a^2 phi0))^(-1/3).                                                                      (2)
"""

from __future__ import annotations

import math
import sys
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from _common import Groups, Statement, compared, differing, direct_label, page_of, paragraph, plain_ticks, report
from scipy.optimize.elementwise import find_root

import sweep
from sweep.show.charts import COLOURS, DASHES, MARKS

LARGE = 5.0
"""Way beyond the switch over phi0, by (1), from which (1) is held to `CLOSE` of s."""
CLOSE = 0.01
STEPS = 2
"""Steps of the torque's axis to which the best torque is found: the least is flat."""
POINTS = 2000

NOTES = """\
s = -dlnP/dlnmu; deviation: of exponents the difference; (1) is solved for every third friction R and fourth drag c
allowed: 0.01 of s and two steps of 12 % of the torque where the foliot swings 5 phi0 beyond the switch; 8 % of (2), a
limit; 0.06 of its power -1/3; 2 %, the tolerance of the refinement, between its cells\
"""


def thinned(ds: xr.Dataset) -> xr.Dataset:
    """Least exponents of some of the clocks, in memory."""
    part = ds[["sensitivity_min", "sensitivity_argmin_mu"]]
    many = {"R": slice(None, None, 3), "c": slice(None, None, 4)}
    return part.isel({name: cut for name, cut in many.items() if ds.sizes[name] > 40}).load()


def balanced(clocks: xr.Dataset, mu: xr.DataArray) -> xr.Dataset:
    """By (1), for each clock: the least `s`, its torque `mu`, and the way beyond the switch over phi0 there."""
    a, phi0 = float(clocks.a), float(clocks.phi0)

    def losses(v: Any, n: Any, e: Any, R: Any, c: Any, mu: Any) -> tuple[Any, ...]:
        drag = 2 * c * v ** (n + 2) / ((n + 2) * mu)
        return R * v**2 / mu, 2 * a * v**3 / (3 * mu), drag, 0.5 * (1 - e**2) * v**2

    def unpaid(log_v: Any, *terms: Any) -> Any:
        return sum(losses(np.exp(log_v), *terms)) - 2 * terms[-1] * phi0

    terms = xr.broadcast(*(clocks[name] for name in ("n", "e", "R", "c")), mu)
    found = find_root(unpaid, (math.log(1e-6), math.log(1e10)), args=tuple(x.values for x in terms))
    v = terms[0].copy(data=np.exp(found.x))
    n, _, R, _, mu = terms
    dry, viscous, drag, struck = (x / (2 * mu * phi0) for x in losses(v, *terms))
    N = viscous + n * drag
    s = ((N + struck) / (N + 2) + dry / ((mu / R) ** 2 - 1)).where(mu > R, math.inf)
    best = s.argmin("mu")
    beyond = v**2 / (2 * mu * phi0)
    return xr.Dataset({"s": s, "mu": mu.drop_vars("mu"), "beyond": beyond}).isel(mu=best)


def best_torques(ds: xr.Dataset) -> list[Statement]:
    """Where s is least, against (1), (2) and what the paper says of strong drive."""
    clocks = thinned(ds)
    theory = balanced(clocks, ds.mu)
    far = theory.beyond > LARGE
    off = abs(clocks.sensitivity_min - theory.s).where(far)
    step = float(np.diff(np.log(ds.mu.values)).mean())
    steps = abs(np.log(clocks.sensitivity_argmin_mu / theory.mu)).where(far) / step
    least, at = ds.sensitivity_min.load(), ds.sensitivity_argmin_mu.load()
    inside = float(((at > ds.mu[0]) & (at < ds.mu[-1])).mean())
    line = least.sel(e=1).isel(n=0, c=0)
    high = line.where(line.R > 1e3, drop=True)
    power = np.polyfit(np.log(high.R.values), np.log(high.values), 1)[0].item()
    limit = 3 * (18 * float(high.R[-1])) ** (-1 / 3)
    return [
        Statement(f"least s by (1), {LARGE:g} phi0 beyond the switch", "s", f"{int(far.sum())} clocks",
                  float(off.max()), bool(off.max() < CLOSE)),
        Statement("  the torque where it is", "(1)", f"within {float(steps.max()):.0f} steps", None,
                  bool(steps.max() < STEPS + 0.5)),
        compared(f"light viscous friction, R = {float(high.R[-1]):g}: least s", f"(2) {limit:.4f}",
                 float(high[-1]), limit, 0.08, 4),
        differing("  its power of R, R > 1000", "-1/3", power, -1 / 3, 0.06, 4),
        Statement("strong drive is best (paper, of viscous friction)", "every clock",
                  f"{1 - inside:.0%} of {least.size}", None, inside < 0.01, True),
    ]  # fmt: skip


def borders(fine: xr.Dataset) -> list[Statement]:
    """What refinement along the borders is worth: s between its cells, against the kernel there."""
    random = np.random.default_rng(1)
    ends = {name: (float(fine[name].min()), float(fine[name].max())) for name in ("c", "mu")}
    at = {
        name: np.exp(random.uniform(*np.log(span), POINTS // 50 if name == "c" else 50)) for name, span in ends.items()
    }
    here = sweep.interpolated(fine, at).sensitivity
    fixed = {name: float(fine[name]) for name in ("a", "e", "n", "phi0")}
    study = sweep.study(
        kernel="foliot", axes={k: sorted(v) for k, v in at.items()}, fixed=fixed, rtol=1e-8, outputs=["sensitivity"]
    )
    true = sweep.run(study).sensitivity
    off = float(abs(here.sortby(["c", "mu"]).transpose("c", "mu").values / true.transpose("c", "mu").values - 1).max())
    cells = int(fine.sensitivity.size)
    return [
        Statement(f"s between {cells} cells, {here.size} places", "2 %", "largest error", off, off < 0.02),
        Statement("  of the cells near a border, s changing", "most", f"{near_borders(fine):.0%}", None,
                  near_borders(fine) > 0.5),
    ]  # fmt: skip


def near_borders(fine: xr.Dataset) -> float:
    """Share of the cells where s is farther than 0.01 from 1, 1/3, 1/2 and 3/5."""
    s = fine.sensitivity.values
    return float(np.mean(np.min([abs(s - x) for x in (1, 1 / 3, 1 / 2, 3 / 5)], axis=0) > 0.01))


def answer(ds: xr.Dataset) -> list[str]:
    """The conclusion, with the numbers of the dataset."""
    least, at = ds.sensitivity_min.load(), ds.sensitivity_argmin_mu.load()
    inside = (at > ds.mu[0]) & (at < ds.mu[-1])
    under = {x: float((least < x).mean()) for x in (1 / 3 - 1e-3, 0.2, 0.1)}
    k = np.unravel_index(int(np.nanargmin(least.values)), least.shape)
    cell = least[k]
    ratio = float(at[k] / cell.R)
    by_e = ", ".join(
        f"{float(least.sel(e=e, method='nearest').min()):.3f} at e = {e:g}" for e in (1, 0.99, 0.9) if e in ds.e
    )
    return paragraph(f"""In a line: of {least.size} clocks {float(inside.mean()):.0%} have their best torque within
        the twelve decades, and {under[1 / 3 - 1e-3]:.0%} of all come to be steadier than strong drive with viscous
        friction, s = 1/3; {under[0.2]:.0%} come below s = 0.2 and {under[0.1]:.0%} below 0.1. The steadiest has
        s = {float(cell):.4f}, with R = {float(cell.R):g} a^2 phi0 and a torque of {ratio:.1f} R; the least is
        {by_e}.""")


def figure(ds: xr.Dataset, fine: xr.Dataset) -> Any:
    """How many clocks come how low, the least s over dry friction, and the refined borders; for two columns."""
    with page_of(68.0, 1, 3) as (page, panels):
        draw_shares(panels[0], ds)
        draw_least(panels[1], ds)
        draw_borders(page, panels[2], fine)
    return page


SHOWN = (1.0, 0.99, 0.9, 0.5)
"""Restitutions that are drawn."""


def draw_shares(axes: Any, ds: xr.Dataset) -> None:
    """Share of the clocks whose least s is below a value."""
    for k, e in enumerate(SHOWN):
        least = np.sort(ds.sensitivity_min.sel(e=e, method="nearest").values.ravel())
        axes.plot(least, np.linspace(0, 100, least.size), color=COLOURS[k], linestyle=DASHES[k], label=f"{e:g}")
    axes.axvline(1 / 3, color="0.5", linewidth=0.7)
    axes.set(xlabel="least exponent, $s$ [1]", ylabel="clocks below it [%]", xlim=(0, 0.6), ylim=(0, 100))
    axes.legend(title="restitution, $e$", loc="upper left", fontsize=7, title_fontsize=7)


def draw_least(axes: Any, ds: xr.Dataset) -> None:
    """Least s over dry friction with hardly any drag, with (1) and (2)."""
    part = ds[["sensitivity_min"]].isel(c=[0]).sel(n=[3.0]).isel(R=slice(None, None, 3)).load()
    part = part.where(part.R > 1, drop=True)
    theory = balanced(part, ds.mu)
    for k, e in enumerate(SHOWN):
        here, line = (x.sel(e=e, method="nearest").isel(n=0, c=0) for x in (part.sensitivity_min, theory))
        look = {"color": COLOURS[k], "linestyle": "", "markerfacecolor": "white", "markersize": 3}
        axes.loglog(here.R, here, MARKS[k], label=f"$e={e:g}$", **look)
        far = line.beyond > LARGE
        axes.plot(line.R, line.s.where(far), color=COLOURS[k])
    R = np.geomspace(10, 1e4, 20)
    axes.plot(R, 3 * (18 * R) ** (-1 / 3), color="black", linewidth=0.8, linestyle=":", label="(2)")
    axes.plot([], [], color="black", label="(1)")
    axes.set(xlabel=r"dry friction, $R/(a^2\varphi_0)$ [1]", ylabel="least $s$ [1]", ylim=(0.04, 0.7))
    plain_ticks(axes.yaxis, (0.05, 0.1, 0.2, 0.5))
    axes.legend(loc="lower left", fontsize=7)


def draw_borders(page: Any, axes: Any, fine: xr.Dataset) -> None:
    """s over torque and drag, with the cells of the refinement."""
    at = {name: np.geomspace(float(fine[name].min()), float(fine[name].max()), 120) for name in ("c", "mu")}
    s = sweep.interpolated(fine, at).sensitivity.transpose("c", "mu")
    mesh = axes.pcolormesh(s.mu, s.c, s, vmin=1 / 3, vmax=1, cmap="cividis", shading="nearest", rasterized=True)
    page.colorbar(mesh, ax=axes, label="exponent, $s$ [1]", pad=0.02)
    axes.plot(fine.mu.values.ravel(), fine.c.values.ravel(), ".", color="white", markersize=1.2, label="cells")
    for x, y, text in ((3e-2, 1e-6, "1"), (1e3, 1e-6, "1/3"), (1e7, 3e-7, "1/2"), (1e6, 1e-2, "3/5")):
        direct_label(axes, x, y, text, fontsize=7)
    axes.set(
        xscale="log", yscale="log", xlabel=r"torque, $\mu/(a^2\varphi_0)$ [1]", ylabel=r"drag, $c\,a\varphi_0^2$ [1]"
    )


def conclude(path: str, borders_path: str) -> tuple[Groups, list[str], Any]:
    """Statements and the figure."""
    ds = sweep.open_result(path, strict=True)
    fine = sweep.open_result(borders_path, strict=True).load()
    if "sensitivity_argmin_mu" not in ds or set(ds.sensitivity_min.dims) != {"n", "e", "R", "c"}:
        raise sweep.SweepError(f"{path} is not of this study; make it from law_map_overnight.toml")
    groups = {"The best torque": best_torques(ds), "Along the borders": borders(fine)}
    return groups, [NOTES, "", *answer(ds)], lambda: figure(ds, fine)


main = partial(report, __file__, ["law_map_overnight.h5", "law_map_borders_fine.h5"], conclude=conclude)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
