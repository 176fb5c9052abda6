"""The arena from above as SVG: walls, obstacles, and robots or agents with their numbers, headings and lit rings."""

import math
from xml.etree.ElementTree import Element

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.display.html import element

SIDE_PX = 320
"""Longer side of a picture in pixels."""

MOST_NUMBERED = 50
"""Swarms of this size or larger are drawn without numbers."""

SHARE_OF_NUMBERS = 1.1
"""Height of numbers on discs, in radii."""

SMALLEST_NUMBERS = 26
"""The longer side of a picture, in heights of the smallest legible number."""

MARGIN = 0.03
"""Margin around the walls, as a share of the longer side."""

LIT, DARK, OBSTACLE = "#ff503c", "#6b7280", "#9aa3ad"
"""Colours of discs whose ring is lit, of other discs, and of obstacles; legible on white and on black."""

MIN_HEIGHT = 0.1
"""Height of the picture of a segment, whose own is 0, as a share of its length."""


def draw_arena(arena: Arena, poses: FloatArray, radius_cm: float, ring_on: BoolArray) -> Element:
    """Return a picture of an arena, with y upwards.

    Args:
        arena: The arena.
        poses: (n, 3) cm, cm, rad: x, y and heading of robots or agents; headings may be NaN, and
            places of those that are not drawn.
        radius_cm: Radius of their discs.
        ring_on: (n,) whether each ring is lit.
    """
    width = arena.width_cm
    height = max(arena.height_cm, MIN_HEIGHT * width)
    longer, middle = max(width, height), (height - arena.height_cm) / 2
    margin, stroke = MARGIN * longer, longer / 150
    font = max(SHARE_OF_NUMBERS * radius_cm, longer / SMALLEST_NUMBERS)
    scale = SIDE_PX / (longer + 2 * margin)
    top, bottom = middle, middle + arena.height_cm
    walls = " ".join(f"{_text(x)},{_text(y)}" for x, y in ((0, top), (width, top), (width, bottom), (0, bottom)))
    parts = [element("polygon", points=walls, fill="none", stroke="currentColor", stroke_width=_text(stroke))]
    for x, y, radius in arena.circles.tolist():
        parts.append(_circle(x, height - middle - y, radius, fill=OBSTACLE))
    for corners in arena.polygons:
        points = " ".join(f"{_text(x)},{_text(height - middle - y)}" for x, y in corners.tolist())
        parts.append(element("polygon", points=points, fill=OBSTACLE))
    for number, ((x, y, heading), is_lit) in enumerate(zip(poses.tolist(), ring_on.tolist(), strict=True)):
        if math.isnan(x):  # it is not in the arena
            continue
        label = str(number) if len(poses) < MOST_NUMBERED else ""
        parts.append(_draw_robot(label, (x, height - middle - y), heading, radius_cm, font, is_lit=is_lit))
    return element(
        "svg",
        *parts,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=" ".join(map(_text, (-margin, -margin, width + 2 * margin, height + 2 * margin))),
        width=round(scale * (width + 2 * margin)),
        height=round(scale * (height + 2 * margin)),
        role="img",
        aria_label="the arena from above",
    )


def _draw_robot(
    label: str, place: tuple[float, float], heading: float, radius: float, font: float, *, is_lit: bool
) -> Element:
    x, y = place
    parts = [_circle(x, y, radius, fill=LIT if is_lit else DARK)]
    if not math.isnan(heading):
        front = (x + radius * math.cos(heading), y - radius * math.sin(heading))
        ends = dict(zip(("x1", "y1", "x2", "y2"), map(_text, (x, y, *front)), strict=True))
        parts.append(element("line", stroke="white", stroke_width=_text(0.25 * radius), **ends))
    if label:
        parts.append(_write_number(label, place, radius, font))
    state = "lit" if is_lit else "dark"
    return element("g", element("title", f"{label}: {state}" if label else state), *parts, class_=state)


def _write_number(label: str, place: tuple[float, float], radius: float, font: float) -> Element:
    """Return a number on its disc, or beside it where the disc has no room for it."""
    style: dict[str, object] = {"font_family": "sans-serif", "font_size": _text(font), "dominant_baseline": "central"}
    x, y = place
    if font > SHARE_OF_NUMBERS * radius:
        return element("text", label, x=_text(x + 1.2 * radius), y=_text(y), fill="currentColor", **style)
    outline = {"stroke": "#1c2126", "stroke_width": _text(0.2 * radius), "paint_order": "stroke"}
    return element("text", label, x=_text(x), y=_text(y), fill="white", text_anchor="middle", **outline, **style)


def _circle(x: float, y: float, radius: float, **attributes: object) -> Element:
    return element("circle", cx=_text(x), cy=_text(y), r=_text(radius), **attributes)


def _text(number: float) -> str:
    """Return a coordinate in cm as short as a picture needs it."""
    return f"{number:.5g}"
