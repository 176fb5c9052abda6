"""What a full recording shows of point-like agents: how far each sees or is seen, and who hears whom."""

import math
from collections.abc import Iterator

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arrays import FloatArray
from epuck_sim.recording.buffers.robots import Columns
from epuck_sim.recording.chunks import moving, still
from epuck_sim.recording.layers.arena import FAINT, ends_of_rays, strip_columns, towards
from epuck_sim.recording.population import Population
from epuck_sim.scenario.particles import Cone, ParticleScenario, Range

CONES = "/arena/cones"
"""(agents,) strips in each row, around the cone of vision or emission, within the arena."""

RANGES = "/arena/ranges"
"""(agents,) circles in each row, as far as a pulse is heard."""

LINKS = "/arena/links"
"""Arrows at each instant, from who fires to who hears its pulse; of class 1 where that shifts a phase."""

DRAWN_SHARE = 1 / 8
"""Of the side: so far a cone is drawn that has no end."""

STEP_RAD = math.radians(12)
"""From corner to corner of an arc, at most."""

HEARD = rr.AnnotationContext([(0, "hears", (95, 105, 135)), (1, "is shifted", (240, 200, 40))])


class SwarmDetails:
    """What agents hear.

    Cones are drawn in squares only: in a segment there is no angle, and a cube is seen from above.
    """

    def __init__(self, scenario: ParticleScenario, subject: Population) -> None:
        rule = scenario.neighbourhood
        radius_cm = rule.radius_cm if isinstance(rule, Cone | Range) else None
        is_sector = isinstance(rule, Cone) and rule.angle_deg < 360
        self._subject = subject
        self._range_cm = None if is_sector else radius_cm
        self._cone_cm = DRAWN_SHARE * scenario.space.side_cm if radius_cm is None else radius_cm
        self._arc: FloatArray | None = None
        """(corners,) rad from the heading."""
        if isinstance(rule, Cone) and is_sector and scenario.space.dimensions == 2:
            half = math.radians(rule.angle_deg) / 2
            self._arc = np.linspace(-half, half, 1 + math.ceil(2 * half / STEP_RAD))

    def still(self) -> Iterator[Chunk]:
        """Yield what does not move, and how it looks."""
        thin = 0.03 * self._subject.radius_cm
        if self._arc is not None:
            yield still(CONES, rr.LineStrips2D.from_fields(colors=FAINT, radii=thin, draw_order=10))
        if self._range_cm is not None:
            sizes = np.full((self._subject.size, 2), self._range_cm)
            yield still(RANGES, rr.Ellipses2D.from_fields(half_sizes=sizes, colors=FAINT, line_radii=thin))
        yield still(LINKS, HEARD)
        yield still(LINKS, rr.Arrows2D.from_fields(radii=2 * thin, show_labels=False, draw_order=15))

    def moving(self, columns: Columns) -> Iterator[Chunk]:
        """Yield what these rows show."""
        middles, time_ns = columns.poses[..., :2], columns.time_ns
        if self._arc is not None:
            rays = towards(columns.poses[..., 2, None] + self._arc)
            apex = middles[:, :, None]
            arc = ends_of_rays(apex, rays, self._cone_cm, self._subject.arena)
            yield moving(CONES, time_ns, *strip_columns(np.concatenate([apex, arc, apex], axis=2)))
        if self._range_cm is not None:
            each = np.full(len(time_ns), self._subject.size)
            circles = rr.Ellipses2D.columns(centers=middles.reshape(-1, 2))
            yield moving(RANGES, time_ns, *circles.partition(each))
        rows, firing, hearing, is_shifted = columns.links.T
        ways = middles[rows, hearing] - middles[rows, firing]
        if self._subject.is_cyclic:  # round by the edge where that is shorter
            side_cm = self._subject.arena.width_cm
            ways -= side_cm * np.rint(ways / side_cm)
        arrows = rr.Arrows2D.columns(
            origins=middles[rows, firing], vectors=ways, class_ids=is_shifted.astype(np.uint16)
        )
        yield moving(LINKS, time_ns, *arrows.partition(np.bincount(rows, minlength=len(time_ns))))

    def rest(self) -> tuple[Chunk, ...]:
        """Return what was held back: nothing."""
        return ()
