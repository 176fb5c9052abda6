"""The arena from above as SVG: floor, walls, obstacles, lamps, and robots or agents with numbers and lit rings."""

import math
from base64 import b64encode
from collections.abc import Iterable, Iterator
from dataclasses import replace
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena, floor_levels
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.display.html import element

SIDE_PX = 320  # longer side of a picture in pixels
MOST_NUMBERED = 50  # swarms of this size or larger are drawn without numbers
SHARE_OF_NUMBERS = 1.1  # height of numbers on discs, in radii
SMALLEST_NUMBERS = 26  # the longer side of a picture, in heights of the smallest legible number
LAMP = "#ffc800"  # colour of lamps
MARGIN = 0.03  # margin around the walls, as a share of the longer side

LIT, DARK, OBSTACLE = "#ff503c", "#6b7280", "#9aa3ad"
"""Colours of discs whose ring is lit, of other discs, and of obstacles; legible on white and on black."""

MIN_HEIGHT = 0.1  # height of the picture of a segment, whose own is 0, as a share of its length


def draw_arena(arena: Arena, poses: FloatArray, radii_cm: npt.ArrayLike, ring_on: BoolArray) -> Element:
    """Return a picture of an arena, with y upwards, and of robots or agents.

    Poses are (n, 3) cm, cm, rad; headings may be NaN, and places are NaN for those that are not drawn. Radii are (n,),
    or one for all; `ring_on` is (n,), whether each ring is lit.
    """
    width = arena.width_cm
    height = max(arena.height_cm, MIN_HEIGHT * width)
    longer, middle = max(width, height), (height - arena.height_cm) / 2
    margin, stroke = MARGIN * longer, longer / 150
    scale = SIDE_PX / (longer + 2 * margin)
    top, bottom = middle, middle + arena.height_cm
    walls = _corners([(0, top), (width, top), (width, bottom), (0, bottom)])
    parts = [element("polygon", points=walls, fill="none", stroke="currentColor", stroke_width=stroke)]
    if not arena.floor.is_white:
        box = f"0 0 {width:.5g} {arena.height_cm:.5g}"  # a picture in the picture is clipped at its edges
        place = {"x": 0, "y": top, "width": width, "height": arena.height_cm}
        parts.insert(0, element("svg", *_draw_floor(arena), viewBox=box, class_="floor", **place))
    parts += [_circle(x, height - middle - y, radius, fill=OBSTACLE) for x, y, radius in arena.circles.tolist()]
    for corners in arena.polygons:
        points = _corners((x, height - middle - y) for x, y in corners.tolist())
        parts.append(element("polygon", points=points, fill=OBSTACLE))
    for x, y, height_cm, strength in arena.lamps.tolist():
        title = element("title", f"lamp: {height_cm:g} cm, strength {strength:g}")
        parts.append(element("g", title, _circle(x, height - middle - y, arena.lamp_cm, fill=LAMP), class_="lamp"))
    each = zip(poses.tolist(), np.broadcast_to(radii_cm, len(poses)).tolist(), ring_on.tolist(), strict=True)
    for number, ((x, y, heading), radius_cm, is_lit) in enumerate(each):
        if math.isnan(x):  # it is not in the arena
            continue
        label = str(number) if len(poses) < MOST_NUMBERED else ""
        font = max(SHARE_OF_NUMBERS * radius_cm, longer / SMALLEST_NUMBERS)
        parts.append(_draw_robot(label, (x, height - middle - y), heading, radius_cm, font, is_lit=is_lit))
    sides = width + 2 * margin, height + 2 * margin
    box = " ".join(f"{each:.5g}" for each in (-margin, -margin, *sides))
    size = {"width": round(scale * sides[0]), "height": round(scale * sides[1])}
    head = {"xmlns": "http://www.w3.org/2000/svg", "viewBox": box, **size}
    return element("svg", *parts, **head, role="img", aria_label="the arena from above")


def _draw_floor(arena: Arena) -> Iterator[Element]:
    floor, size = arena.floor, {"width": arena.width_cm, "height": arena.height_cm}
    if floor.picture.size:
        levels = floor_levels(replace(arena, floor=replace(floor, patches=floor.patches[:0])), SIDE_PX)
        import cv2  # noqa: PLC0415 is needed, and installed, where there are pictures

        png = b64encode(cv2.imencode(".png", levels)[1].tobytes()).decode()
        yield element("image", href=f"data:image/png;base64,{png}", preserveAspectRatio="none", **size)
    else:
        yield element("rect", fill=_grey(floor.brightness), **size)
    for patch in floor.patches:
        grey = _grey(float(patch["brightness"]))
        if patch["edge_count"]:
            edges = floor.edges[patch["first_edge"] :][: patch["edge_count"]]
            points = _corners((x, arena.height_cm - y) for x, y, _, _ in edges.tolist())
            yield element("polygon", points=points, fill=grey)
        else:
            yield _circle(patch["x"], arena.height_cm - patch["y"], patch["radius"], fill=grey)


def _grey(brightness: float) -> str:
    return "#" + 3 * f"{round(255 * brightness):02x}"


def _draw_robot(
    label: str, place: tuple[float, float], heading: float, radius: float, font: float, *, is_lit: bool
) -> Element:
    x, y = place
    parts = [_circle(x, y, radius, fill=LIT if is_lit else DARK)]
    if not math.isnan(heading):
        front = {"x2": x + radius * math.cos(heading), "y2": y - radius * math.sin(heading)}
        parts.append(element("line", stroke="white", stroke_width=0.25 * radius, x1=x, y1=y, **front))
    if label:
        style: dict[str, object] = {"font_family": "sans-serif", "font_size": font, "dominant_baseline": "central"}
        looks: dict[str, object] = {"x": x + 1.2 * radius, "y": y, "fill": "currentColor"}  # beside the disc
        if font <= SHARE_OF_NUMBERS * radius:
            looks = {"x": x, "y": y, "fill": "white", "text_anchor": "middle", "stroke": "#1c2126"}
            looks |= {"stroke_width": 0.2 * radius, "paint_order": "stroke"}
        parts.append(element("text", label, **looks, **style))
    state = "lit" if is_lit else "dark"
    return element("g", element("title", f"{label}: {state}" if label else state), *parts, class_=state)


def _circle(x: float, y: float, radius: float, **attributes: object) -> Element:
    return element("circle", cx=x, cy=y, r=radius, **attributes)


def _corners(points: Iterable[tuple[float, float]]) -> str:
    return " ".join(f"{x:.5g},{y:.5g}" for x, y in points)
