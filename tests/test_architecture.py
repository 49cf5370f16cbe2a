"""The picture in ARCHITECTURE.md is true."""

from pathlib import Path

import draw_rooms

ROOT = Path(__file__).parent.parent


def test_the_picture_shows_the_rooms_and_imports_of_today():
    assert draw_rooms.PICTURE.read_text(encoding="utf-8") == draw_rooms.draw(), "run: python docs/draw_rooms.py"


def test_an_arrow_that_follows_from_others_is_left_out():
    edges = {("a", "b"), ("b", "c"), ("a", "c"), ("a", "d"), ("d", "c"), ("c", "e"), ("a", "e")}
    assert draw_rooms.without_implied(edges) == [("a", "b"), ("a", "d"), ("b", "c"), ("c", "e"), ("d", "c")]


def test_every_room_has_a_floor():
    for package in draw_rooms.PACKAGES:
        rooms = {path.stem for path in (ROOT / package).iterdir() if not path.name.startswith("_")}
        named = {name.partition(".")[2] for level in draw_rooms.floors(package) for name in level}
        assert rooms == named | {name.partition(".")[2] for name in draw_rooms.CONTRACT if name.startswith(package)}
