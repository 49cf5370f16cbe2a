"""Draws the rooms of both packages and what they import: docs/rooms.svg, the picture of ARCHITECTURE.md.

    python docs/draw_rooms.py

Floors are those of the contracts in pyproject.toml, arrows the imports that grimp finds in the sources. An arrow that
follows from others is left out. The same tree gives the same bytes; `tests/test_architecture.py` draws it again.
"""

from __future__ import annotations

import ast
import re
import textwrap
import tomllib
from dataclasses import dataclass
from html import escape
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "rooms.svg"
PACKAGES = ("kernels", "sweep")
CONTRACT = ("kernels.catalogue", "kernels.interface")
"""Modules between the packages; drawn on the two lowest floors."""

BOX_WIDTH, BOX_HEIGHT, FLOOR, GAP = 164, 84, 124, 14
MARGIN, HEADING, LANE, TIP = 18, 50, 15, 5
CHARACTERS = 24
"""Of a line within a box."""
COLOURS = {"kernels": ("#fbf3e4", "#d9a441"), "sweep": ("#eaf1f9", "#5b8db8"), "contract": ("#ecf5ec", "#5d9b63")}
TITLES = {"kernels": "kernels/ · the physics", "sweep": "sweep/ · the engine", "contract": "the contract"}

Edge = tuple[str, str]


@dataclass(frozen=True)
class Box:
    """Where a room is drawn: its upper left corner, and its floor, from 0 for the ground."""

    name: str
    panel: str
    floor: int
    x: float
    y: float

    @property
    def middle(self) -> float:
        return self.x + BOX_WIDTH / 2


def floors(package: str) -> list[list[str]]:
    """Rooms of a package, the highest floor first, by the contract of import-linter."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    (layers,) = (c["layers"] for c in contracts if c["type"] == "layers" and c["containers"] == [package])
    return [[f"{package}.{name.strip()}" for name in re.split(r"[|:]", layer)] for layer in layers]


def imports(rooms: set[str]) -> set[Edge]:
    """Which room imports which."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    found = {
        (".".join(module.split(".")[:2]), ".".join(other.split(".")[:2]))
        for module in graph.modules
        for other in graph.find_modules_directly_imported_by(module)
    }
    return {(a, b) for a, b in found if a != b and a in rooms and b in rooms}


def without_implied(edges: set[Edge]) -> list[Edge]:
    """Edges but for those that a longer way stands for."""
    return sorted((a, b) for a, b in edges if not any(c != b and _leads(c, b, edges) for x, c in edges if x == a))


def _leads(start: str, end: str, edges: set[Edge]) -> bool:
    return start == end or any(_leads(other, end, edges) for room, other in edges if room == start)


def purpose(room: str) -> str:
    """What the docstring of a room begins with, up to its first stop."""
    path = ROOT / room.replace(".", "/")
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return re.split(r"[:;.](?:\s|$)", text.replace("`", ""), maxsplit=1)[0]


def place() -> tuple[list[Box], dict[str, tuple[float, float]], float]:
    """All boxes, left edge and width of each panel, and the height of the picture."""
    rows = {"kernels": floors("kernels"), "contract": [[name] for name in CONTRACT], "sweep": floors("sweep")}
    most = max(map(len, rows.values()))
    boxes, panels, left = [], {}, float(MARGIN)
    for panel, levels in rows.items():
        inner = max(len(level) for level in levels) * (BOX_WIDTH + GAP) - GAP
        lanes = 3 * LANE if panel == "sweep" else 0
        panels[panel] = left, inner + 2 * MARGIN + lanes
        for k, level in enumerate(levels):
            floor = len(levels) - 1 - k
            start = left + MARGIN + (inner - len(level) * (BOX_WIDTH + GAP) + GAP) / 2
            y = HEADING + MARGIN + (most - 1 - floor) * FLOOR
            boxes += [Box(name, panel, floor, start + i * (BOX_WIDTH + GAP), y) for i, name in enumerate(level)]
        left += panels[panel][1] + 2 * GAP
    return boxes, panels, HEADING + MARGIN + most * FLOOR


def curve(x0: float, y0: float, x1: float, y1: float, bent: float, upright: bool) -> str:
    """From a point to another, leaving and arriving upright or level, by control points so far from both."""
    dx, dy = (0.0, bent) if upright else (bent, 0.0)
    return f"M{x0:.0f},{y0:.0f} C{x0 + dx:.0f},{y0 + dy:.0f} {x1 - dx:.0f},{y1 - dy:.0f} {x1:.0f},{y1:.0f}"


def arrow(a: Box, b: Box) -> str:
    """From a room to one on the next floor, or across to another panel."""
    if a.panel == b.panel:
        return curve(a.middle, a.y + BOX_HEIGHT, b.middle, b.y - TIP, 26, upright=True)
    side = 1 if b.x > a.x else -1
    x0, x1 = a.middle + side * BOX_WIDTH / 2, b.middle - side * (BOX_WIDTH / 2 + TIP)
    return curve(x0, a.y + BOX_HEIGHT / 2, x1, b.y + BOX_HEIGHT / 2, side * 20, upright=False)


def lane(a: Box, b: Box, x: float, entry: int) -> str:
    """Down at x, beside the floors between; of several that arrive at a room, each has a place of its own."""
    y0, y1 = a.y + 0.72 * BOX_HEIGHT, b.y + (0.2 + 0.2 * entry) * BOX_HEIGHT
    bends = f"H{x - 8:.0f} q8,0 8,8 V{y1 - 8:.0f} q0,8 -8,8"
    return f"M{a.x + BOX_WIDTH:.0f},{y0:.0f} {bends} H{b.x + BOX_WIDTH + TIP:.0f}"


def arrows(boxes: list[Box], panels: dict[str, tuple[float, float]]) -> list[str]:
    """All arrows; the longest of those beside the floors runs outermost."""
    where = {box.name: box for box in boxes}
    edges = [(where[a], where[b]) for a, b in without_implied(imports(set(where)))]
    beside = [(a, b) for a, b in edges if a.panel == b.panel and a.floor - b.floor > 1]
    beside.sort(key=lambda edge: (edge[1].floor - edge[0].floor, edge[0].name))
    paths = [arrow(a, b) for a, b in edges if (a, b) not in beside]
    for i, (a, b) in enumerate(beside):
        entry = sum(other == b for _, other in beside[:i])
        paths.append(lane(a, b, sum(panels[a.panel]) - MARGIN + 6 - i * LANE, entry))
    return [f'<path d="{path}" fill="none" stroke="#555" stroke-width="1.4" marker-end="url(#tip)"/>' for path in paths]


def drawn_box(box: Box) -> list[str]:
    stroke = COLOURS[box.panel][1]
    shape = f'x="{box.x:.0f}" y="{box.y:.0f}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="7"'
    lines = textwrap.wrap(purpose(box.name), CHARACTERS, max_lines=4, placeholder=" ...")
    start = box.y + 55 - 7 * (len(lines) - 1)  # centred below the name
    rows = [text(box.middle, box.y + 19, box.name.partition(".")[2], 15, weight="bold")]
    rows += [text(box.middle, start + 14 * i, line, 12, "#444") for i, line in enumerate(lines)]
    return [f'<rect {shape} fill="white" stroke="{stroke}" stroke-width="1.6"/>', *rows]


def text(x: float, y: float, words: str, size: float, colour: str = "#222", weight: str = "normal") -> str:
    font = f'font-size="{size}" font-weight="{weight}" fill="{colour}" text-anchor="middle"'
    return f'<text x="{x:.0f}" y="{y:.1f}" {font}>{escape(words)}</text>'


def drawn_panel(panel: str, boxes: list[Box], left: float, width: float, bottom: float) -> list[str]:
    top = min(box.y for box in boxes if box.panel == panel) - HEADING
    shape = f'x="{left:.0f}" y="{top:.0f}" width="{width:.0f}" height="{bottom - top:.0f}" rx="12"'
    heading = text(left + width / 2, top + 34, TITLES[panel], 19, COLOURS[panel][1], "bold")
    return [f'<rect {shape} fill="{COLOURS[panel][0]}"/>', heading]


HEAD = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" font-family="sans-serif">
<title>Rooms of foliot and what they import</title>
<defs><marker id="tip" viewBox="0 0 8 8" refX="5" refY="4" markerWidth="7" markerHeight="7" orient="auto">
<path d="M0,0 L8,4 L0,8 z" fill="#555"/></marker></defs>
<rect width="{width:.0f}" height="{height:.0f}" fill="white"/>"""
NOTE = "An arrow: imports. What follows from other arrows is left out. Each floor imports from floors below it only."


def draw() -> str:
    """The picture as SVG."""
    boxes, panels, height = place()
    width = sum(panels["sweep"]) + MARGIN
    parts = [line for name, (left, wide) in panels.items() for line in drawn_panel(name, boxes, left, wide, height)]
    parts += arrows(boxes, panels)
    parts += [line for box in boxes for line in drawn_box(box)]
    note = text(width / 2, height + 25, NOTE, 13, "#555")
    return "\n".join([HEAD.format(width=width, height=height + 40), *parts, note, "</svg>\n"])


if __name__ == "__main__":
    PICTURE.write_text(draw(), encoding="utf-8")
