"""Drawings of the machines that the kernels describe, for the pages of theory: `python docs/draw_machines.py`.

Lengths and angles are those of the sources where they give them; the linkage stands where its equations put it.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np

from sweep.show import charts

HERE = Path(__file__).parent / "theory"
INK, WHEEL, BEAM, PALE = "black", charts.COLOURS[5], charts.COLOURS[0], "0.75"


def panel(axes: Any, letter: str, text: str, width: float, low: float, high: float) -> None:
    """No axes, equal units, from -width to width and low to high, a letter and a title."""
    axes.set(xlim=(-width, width), ylim=(low, high), aspect="equal")
    axes.axis("off")
    axes.set_title(f"({letter}) {text}" if letter else text, fontsize=8)


def arrow(axes: Any, start: Any, end: Any, text: str = "", colour: str = INK, **how: Any) -> None:
    """An arrow from one place to another, with its name at the end."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 0.9, **how})
    if text:
        axes.annotate(text, end, (3, 3), textcoords="offset points", color=colour, fontsize=8)


def turned(points: Any, angle: float, centre: Any = (0.0, 0.0)) -> Any:
    """Points (n, 2) turned about a centre."""
    c, s = math.cos(angle), math.sin(angle)
    return (np.asarray(points) - centre) @ np.array([[c, s], [-s, c]]) + centre


def foliot(axes: Any) -> None:
    """A verge from the side: staff with two pallets, foliot with its weights, crown wheel."""
    axes.plot([0, 0], [-1.15, 1.25], color=BEAM, linewidth=2.5)
    axes.plot([-1.6, 1.6], [1.25, 1.25], color=BEAM, linewidth=2.5)
    for x in (-1.45, 1.45):
        axes.plot([x, x], [1.25, 1.0], color=BEAM, linewidth=1)
        axes.fill([x - 0.11, x + 0.11, x + 0.11, x - 0.11], [1.0, 1.0, 0.68, 0.68], color=BEAM)
    for y, side in ((0.62, 1), (-0.62, -1)):
        axes.fill([0, 0.3 * side, 0.3 * side, 0], [y - 0.16, y - 0.16, y + 0.16, y + 0.16], color=BEAM, alpha=0.55)
        axes.text(-0.08 if side > 0 else -0.36, y, "pallet", fontsize=7, ha="right", va="center")
    teeth = np.linspace(-0.9, 0.9, 8)
    edge = [(0.95, -0.95)]
    for low, high in itertools.pairwise(teeth):
        edge += [(0.62, low), (0.26, high - 0.04), (0.62, high)]
    axes.fill(*np.array([*edge, (0.95, 0.95)]).T, color=WHEEL, alpha=0.6)
    axes.plot([0.95, 1.5], [0, 0], color=WHEEL, linewidth=3)
    axes.text(1.0, -0.3, "crown wheel", fontsize=7)
    axes.text(-1.2, 1.02, "foliot", fontsize=7)
    axes.text(0.06, -1.12, "verge", fontsize=7)
    panel(axes, "a", "verge and foliot, from the side", 1.7, -1.6, 1.6)


def pallets(axes: Any) -> None:
    """The same along the verge: where the pallets meet the teeth, the switch, recoil."""
    for base, name, colour in ((math.pi / 2 + 0.87, "upper pallet", INK), (math.pi / 2 - 0.87, "lower pallet", PALE)):
        end = np.array([math.cos(base), math.sin(base)])
        axes.plot([0, end[0]], [0, end[1]], color=BEAM, linewidth=3, alpha=1.0 if colour == INK else 0.45)
        axes.text(*(1.12 * end), name, fontsize=7, ha="center")
    tooth = np.array([(-1.6, 0.0), (-0.62, 0.36), (-0.85, 0.0)])
    axes.fill(*tooth.T, color=WHEEL, alpha=0.6)
    axes.fill(*(tooth * np.array([-1.0, 1.0])).T, color=WHEEL, alpha=0.25)
    arrow(axes, (-1.5, -0.3), (-0.9, -0.3), "upper teeth", WHEEL)
    arrow(axes, (1.5, -0.3), (0.9, -0.3), "lower teeth", WHEEL)
    turn = np.linspace(math.pi / 2 + 0.5, math.pi / 2 - 0.5, 50)
    axes.plot(0.55 * np.cos(turn), 0.55 * np.sin(turn), color=INK, linewidth=0.8)
    for sign in (1, -1):
        at = math.pi / 2 + 0.5 * sign
        axes.plot([0, 1.25 * math.cos(at)], [0, 1.25 * math.sin(at)], color=INK, linewidth=0.6, linestyle=(0, (4, 3)))
        axes.text(
            1.3 * math.cos(at), 1.32 * math.sin(at), rf"${'-' if sign > 0 else '+'}\varphi_0$", fontsize=8, ha="center"
        )
    axes.text(0.0, 0.6, r"$\varphi$", fontsize=8, ha="center")
    axes.plot(0, 0, "o", color=BEAM, markersize=5)
    said = (
        "at $+\\varphi_0$ a tooth leaves one pallet and another\nmeets the other: the torque turns round,\n"
        "and the beam throws the wheel back (recoil)"
    )
    axes.text(0, -0.95, said, fontsize=7, ha="center", va="top")
    panel(axes, "b", "the same, along the verge", 1.7, -1.6, 1.6)


def cross_beat(axes: Any) -> None:
    """Bürgi's two foliots, geared one to one."""
    for x, sign in ((-0.5, 1), (0.5, -1)):
        ring = np.linspace(0, 2 * math.pi, 90)
        wave = 0.48 + 0.025 * np.sign(np.sin(24 * ring))
        axes.plot(x + wave * np.cos(ring), wave * np.sin(ring), color=PALE, linewidth=0.8)
        beam = turned([(-1.1, 0.0), (1.1, 0.0)], math.pi / 2 - 0.25 * sign) + np.array([x, 0.0])
        axes.plot(*beam.T, color=BEAM, linewidth=2.5)
        axes.plot(*beam.T, "s", color=BEAM, markersize=6)
        axes.plot(x, 0, "o", color=INK, markersize=4)
    axes.text(
        0,
        -1.35,
        "two foliots of half the inertia on wheels that gear,\neach with one pallet",
        fontsize=7,
        ha="center",
        va="top",
    )
    panel(axes, "c", "Bürgi's cross-beat", 1.7, -1.6, 1.6)


def pivot(axes: Any) -> None:
    """The balance's pivot in its hole: weight, the forces N and F of the bearing, their moment."""
    ring = np.linspace(0, 2 * math.pi, 200)
    axes.plot(np.cos(ring), np.sin(ring), color=INK, linewidth=1.2, solid_capstyle="round")
    centre, at = np.array([0.11, -0.19]), -math.pi / 2 + 0.52
    axes.fill(centre[0] + 0.78 * np.cos(ring), centre[1] + 0.78 * np.sin(ring), color=BEAM, alpha=0.3)
    touch = centre + 0.78 * np.array([math.cos(at), math.sin(at)])
    arrow(axes, centre, centre + np.array([0.0, -1.0]), "$mg$", charts.COLOURS[1])
    inwards, green = (centre - touch) / 0.78, charts.COLOURS[2]
    along = np.array([inwards[1], -inwards[0]])
    arrow(axes, touch, touch + math.cos(0.52) * inwards, "", green)
    arrow(axes, touch, touch + math.sin(0.52) * along, "$F$", green)
    arrow(axes, touch, touch + np.array([0.0, 1.0]), "", "0.5", linestyle=(0, (4, 3)))
    axes.text(*(touch + 0.5 * inwards + np.array([0.07, 0.0])), "$N$", fontsize=8, color=green)
    axes.plot([centre[0] - 0.78, centre[0]], [centre[1], centre[1]], color=INK, linewidth=0.6, linestyle=(0, (4, 3)))
    axes.text(centre[0] - 0.45, centre[1] + 0.04, "$r$", fontsize=8)
    axes.text(centre[0], 0.38, r"$\dot\theta$", fontsize=8, color=BEAM, ha="center")
    turn = np.linspace(2.4, 0.7, 40)
    tip, before = (centre + 0.5 * np.array([math.cos(t), math.sin(t)]) for t in (0.62, 0.75))
    arrow(axes, before, tip, "", BEAM)
    axes.plot(centre[0] + 0.5 * np.cos(turn), centre[1] + 0.5 * np.sin(turn), color=BEAM, linewidth=1)
    axes.text(
        0,
        -1.35,
        "the pivot climbs until $N$ and $F = \\mu N$ carry $mg$ (dashed):\n"
        r"$R = F r = m g\,r\,\mu/\sqrt{1+\mu^2}$ against the motion",
        fontsize=7,
        ha="center",
        va="top",
    )
    panel(axes, "", "pivot of a balance in its hole", 1.3, -1.75, 1.1)


def linkage(axes: Any, kind: str) -> None:
    """A polishing machine with the paper's names, at a crank angle of 1 rad."""
    b, d, f, e, crank, tool = 0.6201, 0.38, 0.405, 0.1, 1.0, 0.5
    sign = 1 if kind == "A" else -1
    pin = np.array([b + e * math.cos(crank), e * math.sin(crank)])
    reach = math.hypot(*pin)
    alpha = math.atan2(pin[1], pin[0]) + sign * math.acos((reach**2 + d * d - f * f) / (2 * d * reach))
    joint = d * np.array([math.cos(alpha), math.sin(alpha)])
    bend = 0.0 if kind == "A" else math.pi / 2
    centre = tool * np.array([math.cos(alpha + bend), math.sin(alpha + bend)])
    ring = np.linspace(0, 2 * math.pi, 90)
    axes.plot(b + e * np.cos(ring), e * np.sin(ring), color=PALE, linewidth=0.8)
    axes.plot([b, pin[0]], [0, pin[1]], color=INK, linewidth=2)
    axes.plot([pin[0], joint[0]], [pin[1], joint[1]], color=charts.COLOURS[1], linewidth=2)
    axes.plot(*np.array([joint, (0, 0), centre]).T, color=BEAM, linewidth=2.5)
    axes.fill(centre[0] + 0.04 * np.cos(ring), centre[1] + 0.04 * np.sin(ring), color=WHEEL, alpha=0.7)
    places = {"BH": (0, 0), "ME": (b, 0), "EH": pin, "DH": joint, "CH": centre}
    beside = {"CH": (10, -4), **({"DH": (-26, 4)} if kind == "A" else {"BH": (-26, -4)})}
    for name, place in places.items():
        axes.plot(*place, "o", color=INK, markersize=3)
        where = beside.get(name, (4, -9))
        axes.annotate(rf"O$_\mathrm{{{name}}}$", place, where, textcoords="offset points", fontsize=8)
    for text, start, end, side in (
        ("$b$", (0, 0), (b, 0), -1), ("$d$", (0, 0), joint, sign), ("$f$", joint, pin, 1), ("$e$", (b, 0), pin, -1),
    ):  # fmt: skip
        way = np.subtract(end, start)
        normal = side * np.array([-way[1], way[0]]) / math.hypot(*way)
        axes.text(*(start + 0.5 * way + 0.028 * normal), text, fontsize=8, ha="center", va="center")
    axes.plot([0, b], [0, 0], color=PALE, linewidth=0.8, linestyle=(0, (4, 3)))
    panel(axes, kind.lower(), f"type {kind}: {'straight' if kind == 'A' else 'bent'} arm", 0.8, -0.25, 0.55)
    axes.set_xlim(-0.13, 0.85)


def chain(axes: Any, J: list[float], k: list[float], letter: str, text: str, level: float) -> None:
    """Discs on springs, the last one to ground; areas go with the inertias."""
    x = np.arange(len(J)) * (7.0 / len(J)) * 1.0
    gap = x[1] - x[0]
    ends = [*x, x[-1] + gap]
    for i in range(len(J)):
        t = np.linspace(ends[i], ends[i + 1], 60)
        axes.plot(t, level + 0.06 * np.sin(np.linspace(0, 12 * math.pi, 60)), color=PALE, linewidth=0.8)
        axes.text(0.5 * (ends[i] + ends[i + 1]), level - 0.2, f"{k[i]:,.0f}", fontsize=6, ha="center", color="0.4")
    axes.scatter(x, np.full(len(J), level), s=[max(9.0, 60.0 * math.sqrt(10 * j)) for j in J], color=BEAM, zorder=3)
    for i, inertia in enumerate(J):
        axes.text(x[i], level + 0.28, f"{1e3 * inertia:.3g}", fontsize=6, ha="center")
    axes.plot([ends[-1]] * 2, [level - 0.2, level + 0.2], color=INK, linewidth=2)
    axes.text(-0.6, level + 0.5, f"({letter}) {text}", fontsize=8)


def drivetrain(axes: Any) -> None:
    """The source's chain of eight masses and what Rivin's steps a(J3), a(J2), a(J5) make of it."""
    J = [0.0257, 0.00125, 0.000284, 0.000769, 0.00145, 0.0065, 0.096, 0.09944]
    k = [7530.0, 3790.0, 839.0, 1372.0, 4010.0, 2800.0, 5250.0, 1192.0]
    chain(axes, J, k, "a", "eight masses, spindle on the left, motor and its field on the right", 2.0)
    for i in (2, 1, 2):  # J3, J2, and what was J5
        share = k[i - 1] / (k[i - 1] + k[i])
        J[i - 1] += J[i] * share
        J[i + 1] += J[i] * (1 - share)
        k[i - 1] = 1 / (1 / k[i - 1] + 1 / k[i])
        del J[i], k[i]
    chain(axes, J, k, "b", "five, by Rivin's steps: J3, J2 and J5 go to their neighbours", 0.7)
    axes.text(-0.6, 0.15, "above: J [$10^{-3}$ kgf m s$^2$]; below: k [kgf m]", fontsize=7, color="0.4")
    axes.set(xlim=(-0.7, 7.6), ylim=(0.0, 2.8))
    axes.axis("off")


def main() -> None:
    """Draw all of them."""
    with charts.style():
        page = charts.new_figure(charts.PAGE, 66.0)
        for axes, draw in zip(page.subplots(1, 3), (foliot, pallets, cross_beat), strict=True):
            draw(axes)
        charts.save(page, HERE / "verge.svg")
        page = charts.new_figure(80.0, 76.0)
        pivot(page.subplots())
        charts.save(page, HERE / "pivot.svg")
        page = charts.new_figure(charts.PAGE, 70.0)
        for axes, kind in zip(page.subplots(1, 2), "AB", strict=True):
            linkage(axes, kind)
        charts.save(page, HERE / "machines.svg")
        page = charts.new_figure(charts.PAGE, 66.0)
        drivetrain(page.subplots())
        charts.save(page, HERE / "chains.svg")


if __name__ == "__main__":
    main()
