"""What a full recording shows of point-like agents: their cones or ranges, and the pulses between them."""

import math
from collections.abc import Iterator

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arrays import FloatArray
from epuck_sim.recording.chunks import static_chunk, temporal_chunk
from epuck_sim.recording.layers.arena import FAINT, ranges, ray_ends, static_ranges, strip_columns, unit_vectors
from epuck_sim.recording.population import Population
from epuck_sim.recording.rows import RowBatch
from epuck_sim.scenario.particles import Cone, ParticleScenario, Range

CONES = "/arena/cones"
"""Entity with (agents,) strips in each row, around the cone of vision or emission, within the arena."""

LINKS = "/arena/links"
"""Entity with arrows at each instant, from an agent that fires to one that receives; of class 1 if its phase shifts."""

UNBOUNDED_SHARE = 1 / 8
"""Drawn length of a cone of unlimited range, as a share of the side."""

ARC_STEP_RAD = math.radians(12)
"""Largest angle between two corners of an arc, rad."""

PULSES = rr.AnnotationContext([(0, "receives", (95, 105, 135)), (1, "is shifted", (240, 200, 40))])
"""Names and colours of the classes of links: a pulse that is received, and one that shifts the phase as well."""


class AgentLayers:
    """Cones or ranges, and pulse links.

    Cones are drawn in squares only: a segment has no angles, and a cube is seen from above.
    """

    def __init__(self, scenario: ParticleScenario, population: Population) -> None:
        rule = scenario.neighbourhood
        radius_cm = rule.radius_cm if isinstance(rule, Cone | Range) else None
        is_sector = isinstance(rule, Cone) and rule.angle_deg < 360
        self._population = population
        self._range_cm = None if is_sector else radius_cm
        self._cone_cm = UNBOUNDED_SHARE * scenario.space.side_cm if radius_cm is None else radius_cm
        self._arc: FloatArray | None = None
        """(corners,) rad: angles from the heading to the corners of a cone's arc."""
        if isinstance(rule, Cone) and is_sector and scenario.space.dimensions == 2:
            half = math.radians(rule.angle_deg) / 2
            self._arc = np.linspace(-half, half, 1 + math.ceil(2 * half / ARC_STEP_RAD))

    def static_chunks(self) -> Iterator[Chunk]:
        """Yield the appearance of cones, ranges and links."""
        thin = 0.03 * self._population.radii_cm[0]
        if self._arc is not None:
            yield static_chunk(CONES, rr.LineStrips2D.from_fields(colors=FAINT, radii=thin, draw_order=10))
        if self._range_cm is not None:
            yield static_ranges(np.full(self._population.size, self._range_cm), thin)
        yield static_chunk(LINKS, PULSES)
        yield static_chunk(LINKS, rr.Arrows2D.from_fields(radii=2 * thin, show_labels=False, draw_order=15))

    def chunks(self, batch: RowBatch) -> Iterator[Chunk]:
        """Yield cones, ranges and links in these rows."""
        middles, time_ns = batch.poses[..., :2], batch.time_ns
        if self._arc is not None:
            rays = unit_vectors(batch.poses[..., 2, None] + self._arc)
            apex = middles[:, :, None]
            arc = ray_ends(apex, rays, self._cone_cm, self._population.arena)
            yield temporal_chunk(CONES, time_ns, *strip_columns(np.concatenate([apex, arc, apex], axis=2)))
        if self._range_cm is not None:
            yield ranges(middles, batch)
        rows, firing, receiving, is_shifted = batch.links.T
        ways = middles[rows, receiving] - middles[rows, firing]
        if self._population.is_cyclic:  # across the edge where that is shorter
            side_cm = self._population.arena.width_cm
            ways -= side_cm * np.rint(ways / side_cm)
        arrows = rr.Arrows2D.columns(
            origins=middles[rows, firing], vectors=ways, class_ids=is_shifted.astype(np.uint16)
        )
        yield temporal_chunk(LINKS, time_ns, *arrows.partition(np.bincount(rows, minlength=len(time_ns))))

    def final_chunks(self) -> tuple[Chunk, ...]:
        """Return nothing: nothing is held back."""
        return ()
