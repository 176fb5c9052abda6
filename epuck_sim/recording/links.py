"""Who was linked to whom in a recording: who saw, touched or received whom, found from what is drawn.

A recording holds arrows and points, and no numbers of robots at their ends. The ends lie where the robots are, in
single precision, and robots do not overlap: so the nearest robot is the one that is meant.
"""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import Float32Array, FloatArray, IntArray
from epuck_sim.recording.entities import Entities
from epuck_sim.recording.layers.agents import LINKS
from epuck_sim.recording.layers.arena import unit_vectors
from epuck_sim.recording.layers.robots import CONTACTS, SIGHTINGS
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario

LINKED = (SIGHTINGS, CONTACTS, LINKS)
"""Entities with links."""

BETWEEN_CM = 1e-3
"""Largest distance of a contact of two robots from the point between them, cm, as it is recorded."""

BLOCK = 1_000_000
"""Most distances that are computed at a time."""


class Links(NamedTuple):
    """Links of a trial; what its model does not have has no rows."""

    sightings: IntArray
    """(sightings, 4) row, robot that looks, robot in its view, and 1 if that is seen lit."""
    contacts: IntArray
    """(contacts, 3) row, robot, and the robot that it touches, or -1: a wall, obstacle or movable."""
    contact_points: FloatArray
    """(contacts, 2) cm: where they touch, in the same order."""
    pulses: IntArray
    """(pulses, 4) row, agent that fires, agent that receives, and 1 if its phase shifts."""


def read_links(entities: Entities, scenario: Scenario, positions: Float32Array, headings: FloatArray) -> Links:
    """Return the links of a full recording.

    Args:
        entities: The entities `LINKED`.
        scenario: The trial's scenario.
        positions: (rows, count, 2) cm.
        headings: (rows, count) rad.

    Raises:
        ValueError: Some rows are missing.
    """
    middles = _far_if_absent(positions.astype(np.float64))
    if isinstance(scenario, ParticleScenario):
        side_cm = scenario.space.side_cm if scenario.space.boundary == "cyclic" else np.inf
        sightings = np.empty((0, 4), np.int64)
        contacts, points = np.empty((0, 3), np.int64), np.empty((0, 2))
        pulses = _read_arrows(entities, LINKS, middles, middles, side_cm)
    else:
        assert isinstance(scenario, EmbodiedScenario)  # no other model has cameras
        kinds = scenario.robot_kinds
        forward_cm = np.array([kind.camera_forward_cm for kind in kinds])[:, None]
        cameras = _far_if_absent(middles + forward_cm * unit_vectors(headings))
        sightings = _read_arrows(entities, SIGHTINGS, cameras, middles, np.inf)
        contacts, points = _read_contacts(entities, middles, np.array([kind.radius_cm for kind in kinds]))
        pulses = np.empty((0, 4), np.int64)
    return Links(sightings, contacts, points, pulses)


def _far_if_absent(places: FloatArray) -> FloatArray:
    """Return (rows, count, 2) cm with those of robots that are not in the arena, which are NaN, infinitely far away."""
    return np.nan_to_num(places, nan=np.inf)


def _read_arrows(entities: Entities, entity: str, tails: FloatArray, heads: FloatArray, cycle_cm: float) -> IntArray:
    """Return (arrows, 4) row, number at the tail, number at the head, class of each arrow of an entity.

    Args:
        entities: Holds the entity.
        entity: Name of the entity.
        tails: (rows, count, 2) cm: where an arrow of each robot or agent begins.
        heads: (rows, count, 2) cm: where an arrow to each ends.
        cycle_cm: Side of a cyclic space, beyond which an arrow may lead; else infinite.
    """
    rows = _rows_of(entities, entity, "Arrows2D:origins", len(tails))
    origins = entities.values(entity, "Arrows2D:origins").reshape(-1, 2)
    ends = origins + entities.values(entity, "Arrows2D:vectors").reshape(-1, 2)
    classes = entities.values(entity, "Arrows2D:class_ids").astype(np.int64)
    froms, tos = nearest(origins, tails, rows, cycle_cm), nearest(ends, heads, rows, cycle_cm)
    return np.column_stack([rows, froms, tos, classes])


def _read_contacts(entities: Entities, positions: FloatArray, radii_cm: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return (contacts, 3) row, robot, and other robot or -1; and (contacts, 2) cm the points.

    A point between two robots divides the line between their centres as their radii do. On a wall or obstacle it
    belongs to the robot whose surface is nearest.
    """
    rows = _rows_of(entities, CONTACTS, "Points2D:positions", len(positions))
    points = entities.values(CONTACTS, "Points2D:positions").reshape(-1, 2)
    contacts = np.column_stack([rows, np.full((len(rows), 2), -1)])
    for contact, point, places in zip(contacts, points, positions[rows], strict=True):
        contact[1] = first = int((np.hypot(*(places - point).T) - radii_cm).argmin())
        shares = radii_cm[first] / (radii_cm[first] + radii_cm)
        between = places[first] + shares[:, None] * (places - places[first])
        distance_cm = np.hypot(*(between - point).T)
        distance_cm[first] = np.inf
        second = int(distance_cm.argmin())
        if distance_cm[second] <= BETWEEN_CM:
            contact[1:] = sorted((first, second))
    return contacts, points


def _rows_of(entities: Entities, entity: str, component: str, row_count: int) -> IntArray:
    """Return the row of each value of a component; raise ValueError unless the entity has all rows."""
    lengths = entities.lengths(entity, component)
    if len(lengths) != row_count:
        raise ValueError(f"{entity} is missing in some of {row_count} rows")
    return np.repeat(np.arange(row_count), lengths)


def nearest(points: FloatArray, places: FloatArray, rows: IntArray, cycle_cm: float) -> IntArray:
    """Return (points,) the number of the place in its row that is nearest to each point.

    Args:
        points: (points, 2) cm.
        places: (rows, count, 2) cm.
        rows: (points,) row of each point.
        cycle_cm: Side of a cyclic space, across whose edges the nearest place may lie; else infinite.
    """
    found = np.empty(len(points), np.int64)
    block = max(1, BLOCK // max(1, places.shape[1]))
    for start in range(0, len(points), block):
        part = slice(start, start + block)
        away = np.abs(points[part, None] - places[rows[part]])
        if cycle_cm < np.inf:
            away = np.minimum(away, np.abs(cycle_cm - away))
        found[part] = (away**2).sum(axis=2).argmin(axis=1)
    return found
