"""How much less does the period of a pendulum with an anchor depend on its drive torque than a verge and foliot's?

    python studies/anchor.py anchor.h5

The verge's law with a pendulum's restoring force. Theory, by averaging (Airy): phi = A sin wt; the torque, a square
wave that lags by d = asin(phi0/A), gives 4 mu phi0 a cycle, which friction pi w0 w A^2/Q takes; its part against the
displacement, (4 mu/pi) cos d, adds to gravity's. So, with P0 = 2 pi/w0 and s = -dlnP/dlnmu,
    A^2 = 4 mu phi0 Q/(pi w0^2),                                                                       (1)
    P/P0 = 1 + A^2/16 + 11 A^4/3072 - e,     e = 2 mu cos(d)/(pi w0^2 A) = (A^2 - phi0^2)^(1/2)/(2 phi0 Q),   (2)
    s = e/(2 cos(d)^2) - A^2/16 - 11 A^4/1536.                                                         (3)
A stronger drive hastens by recoil and retards by the wider swing; both balance near A^2 = phi0^2 + (4/(phi0 Q))^2.

Here s = -dlnP/dlnmu, and e is the error (2) of the escapement. The theory is of first order in the torque. The next
order has the size of e A^2 and e^2, so that deviations up to e (A^2/4 + 2 e) are allowed. A verge and foliot has s =
1/3 under strong drive against friction, 1/2 where a switch takes all its speed, and more under weak drive (study
foliot_scaling).
"""

import numpy as np
import xarray as xr
from _common import DAY, Claims, all_ok, compared, most, script
from _figures import COLOURS, Axis, Log, direct_label, page, panel


def with_theory(ds: xr.Dataset) -> xr.Dataset:
    """`ds` with the error of its period and `s`, and what (1) to (3) say of them."""
    A = np.sqrt(4 / np.pi * ds.mu * ds.phi0 * ds.Q) / ds.w0
    e = np.sqrt(A**2 - ds.phi0**2) / (2 * ds.phi0 * ds.Q)
    ds = ds.assign(A=A, e=e, s=-ds.period_by_mu, error=ds.period * ds.w0 / (2 * np.pi) - 1)
    s = e / (2 * (1 - (ds.phi0 / A) ** 2)) - A**2 / 16 - 11 * A**4 / 1536
    return ds.assign(error_theory=A**2 / 16 + 11 * A**4 / 3072 - e, s_theory=s, next=e * (A**2 / 4 + 2 * e))


def claims(ds) -> Claims:
    yield "Every cell"
    yield all_ok(ds)
    yield most("amplitude/A - 1, over A^2/16 + e", "0, (1)", (ds.angle_size / ds.A - 1) / (ds.A**2 / 16 + ds.e), 1)
    yield most("P/P0 - 1 off, over the next order", "0, (2)", (ds.error - ds.error_theory) / ds.next, 1)
    yield most("s off, over the next order", "0, (3)", (ds.s - ds.s_theory) / ds.next, 1)
    worst, theory = (1 / 3 / float(abs(s).where(np.degrees(ds.A) < 5).max()) for s in (ds.s, ds.s_theory))
    yield compared("the verge's 1/3 over the largest abs(s), A < 5 degrees", f"{theory:.4g}", worst, theory, 0.01)

    yield "Recoil and circular error in balance"
    for line in (ds.isel(phi0=k) for k in range(ds.sizes["phi0"])):
        A = np.degrees(np.hypot(line.phi0, 4 / (line.phi0 * line.Q)).item())
        here = np.degrees(np.interp(0.0, line.period_by_mu, line.angle_size))
        what = f"phi0 = {np.degrees(line.phi0.item()):g} degrees: A of s = 0 [degrees]"
        yield compared(what, f"{A:.5g}", here, A, 0.005)


SWING = Log("amplitude [degrees]", None, (1.5, 2, 3, 5, 10, 20))
S_SIZE = Log(r"$|s|$, $s=-$d ln $P$/d ln $\mu$", (2e-6, 1))


@panel(SWING, S_SIZE, "lower right")
@panel(Axis("amplitude [degrees]", (0.0, 8.0)), Axis("lost beside small free swings [s/day]", (-35.0, 90.0)))
@page(132.0)
def figure(a, b, ds):
    """How the period depends on the drive, and the period itself, over the swing."""
    a.axhspan(1 / 3, 1 / 2, color="0.8", linewidth=0)
    direct_label(a, 6.0, 0.13, "verge and foliot", "0.4")
    for k, colour in enumerate(COLOURS[:3]):
        line = ds.isel(phi0=k)
        swing, name = np.degrees(line.angle_size), rf"$\varphi_0 = {np.degrees(line.phi0.item()):g}°$"
        a.plot(swing, line.s.where(line.s > 0), color=colour, label=name)
        a.plot(swing, -line.s.where(line.s < 0), color=colour, linestyle="--")
        b.plot(swing, DAY * line.error, color=colour)
        for axes, theory in ((a, abs(line.s_theory)), (b, DAY * line.error_theory)):
            axes.plot(np.degrees(line.A)[::3], theory[::3], "x", color="black", markersize=3.5, markeredgewidth=0.7)
    free = np.linspace(0.0, 8.0, 50)
    b.plot(free, DAY * np.radians(free) ** 2 / 16, color="0.5", linestyle=":")
    direct_label(b, 5.2, 62.0, "circular error", "0.4", ha="right")


main = script(__name__, "anchor.h5", claims, figure, with_theory)
