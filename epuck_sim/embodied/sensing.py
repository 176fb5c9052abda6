"""Functions for sensors in users' files: the floor, lamps, robots and walls at a place.

Each function takes first the `world` that `sense` receives, and runs in compiled and in interpreted sensors alike. For
all else, `world` has the records themselves (see `control.interface.World`).
"""

import math

from epuck_sim.control.interface import World
from epuck_sim.embodied.cells import members_along, rows_along
from epuck_sim.embodied.sensors.sight import to_disc, to_segment
from epuck_sim.embodied.start import clearance_cm as clearance_of
from epuck_sim.util.elementary import sin_cos
from epuck_sim.util.jit import jit_no_alloc

NOBODY = -1  # stands for no robot


@jit_no_alloc
def brightness_at(world: World, x: float, y: float) -> float:
    """Return the brightness of the floor at a point, from 0, black, to 1, white.

    The topmost patch counts, its edge included; where there is none, the picture, which its outermost pixels continue
    beyond the walls, or else the floor's brightness.
    """
    swarm = world.swarm
    for number in range(len(swarm.patches) - 1, -1, -1):
        patch = swarm.patches[number]
        dx, dy = x - patch.x, y - patch.y
        is_inside = patch.edge_count > 0 or dx * dx + dy * dy <= patch.radius * patch.radius
        for index in range(patch.first_edge, patch.first_edge + patch.edge_count):
            edge = swarm.patch_edges[index]
            is_inside &= (edge.bx - edge.ax) * (y - edge.ay) - (edge.by - edge.ay) * (x - edge.ax) >= 0.0
        if is_inside:
            return float(patch.brightness)
    scene = swarm.scene[0]
    if scene.picture_rows == 0:
        return float(scene.brightness)
    rows, columns = scene.picture_rows, scene.picture_columns
    column = int(min(max(x / world.width_cm * columns, 0.0), columns - 1.0))
    row = rows - 1 - int(min(max(y / world.height_cm * rows, 0.0), rows - 1.0))
    return float(swarm.picture[row * columns + column]) / 255.0


@jit_no_alloc
def light_at(world: World, x: float, y: float) -> float:
    """Return the light that all lamps throw on the floor at a point; nothing throws shadows.

    A lamp of height h and strength s throws s * (h**2 / (h**2 + d**2))**1.5 at a horizontal distance d.
    """
    light = 0.0
    for number in range(len(world.swarm.lamps)):
        lamp = world.swarm.lamps[number]
        dx, dy, square = x - lamp.x, y - lamp.y, lamp.height * lamp.height
        share = square / (square + dx * dx + dy * dy)
        light += lamp.strength * share * math.sqrt(share)
    return light


@jit_no_alloc
def clearance_cm(world: World, x: float, y: float) -> float:
    """Return the distance from a point to the nearest wall, obstacle or movable; negative beyond or inside it."""
    clearance: float = clearance_of(world.swarm, x, y, len(world.circles))
    return clearance


@jit_no_alloc
def nearest_robot(world: World, x: float, y: float, range_cm: float, but: int = NOBODY) -> int:
    """Return the number of the robot, except `but`, whose centre is nearest to a point; `NOBODY` if out of range."""
    swarm, reach_cm = world.swarm, min(range_cm, world.width_cm + world.height_cm)  # must be finite to find cells
    inside_x, inside_y = min(max(x, 0.0), world.width_cm), min(max(y, 0.0), world.height_cm)
    nearest, least = NOBODY, range_cm * range_cm
    first_row, last_row = rows_along(inside_y, inside_y, reach_cm, swarm.scene[0])
    for row in range(first_row, last_row + 1):
        start, end = members_along(inside_x, inside_y, inside_x, inside_y, reach_cm, row, swarm)
        for place in range(start, end):
            member = swarm.members[place]
            dx, dy = member.x - x, member.y - y
            square = dx * dx + dy * dy
            is_nearer = square < least or (square == least and (nearest == NOBODY or member.robot < nearest))
            if member.robot != but and is_nearer and swarm.robots[member.robot].present:
                nearest, least = member.robot, square
    return nearest


@jit_no_alloc
def distance_cm(world: World, x: float, y: float, direction: float, range_cm: float, but: int = NOBODY) -> float:
    """Return the distance, cm, along a ray to the first wall, obstacle, movable or robot; infinity if out of range.

    The direction is in rad, counter-clockwise from x. The ray passes through the robot numbered `but`, such as the one
    that senses. A ray that begins beyond a wall meets it at once.
    """
    dy, dx = sin_cos(direction)
    nearest = math.inf
    if dx != 0.0:
        nearest = ((world.width_cm if dx > 0.0 else 0.0) - x) / dx
    if dy != 0.0:
        nearest = min(nearest, ((world.height_cm if dy > 0.0 else 0.0) - y) / dy)
    for number in range(len(world.circles)):
        circle = world.circles[number]
        nearest = min(nearest, to_disc(x, y, dx, dy, circle.x, circle.y, circle.radius))
    for number in range(len(world.edges)):
        edge = world.edges[number]
        nearest = min(nearest, to_segment(x, y, dx, dy, edge.ax, edge.ay, edge.bx, edge.by))
    for number in range(len(world.robots)):
        if number != but:
            other = world.robots[number]
            nearest = min(nearest, to_disc(x, y, dx, dy, other.x, other.y, other.radius_cm))
    return max(nearest, 0.0) if nearest <= range_cm else math.inf
