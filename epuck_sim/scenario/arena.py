"""The section `arena` of a scenario: the walled rectangle, and what stands in it."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from epuck_sim import epuck
from epuck_sim.arena import Arena, clearance_cm, make_arena
from epuck_sim.geometry import box_corners, is_convex
from epuck_sim.scenario.base import ConfigModel, Number, Positive


class Circle(ConfigModel):
    """A round obstacle."""

    shape: Literal["circle"]
    x_cm: Number
    """x of the centre, from the left wall."""
    y_cm: Number
    """y of the centre, from the lower wall."""
    radius_cm: Positive
    """Radius."""


class Box(ConfigModel):
    """A rectangular obstacle around (x_cm, y_cm), turned by heading_rad."""

    shape: Literal["box"]
    x_cm: Number
    """x of the centre, from the left wall."""
    y_cm: Number
    """y of the centre, from the lower wall."""
    width_cm: Positive
    """Length along the heading."""
    height_cm: Positive
    """Length across the heading."""
    heading_rad: Number = 0.0
    """Angle by which the box is turned, counter-clockwise from x."""


class Polygon(ConfigModel):
    """A convex obstacle with its corners counter-clockwise."""

    shape: Literal["polygon"]
    corners_cm: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=3, max_length=100)]
    """`x_cm, y_cm` of each corner."""

    @model_validator(mode="after")
    def _check_convex(self) -> "Polygon":
        if not is_convex(np.array(self.corners_cm)):
            raise ValueError("corners_cm must bound a convex polygon, listed counter-clockwise")
        return self


class Movable(ConfigModel):
    """A disc that robots push: it slides on the floor, and does not turn."""

    shape: Literal["circle"] = "circle"
    x_cm: Number
    """x of the centre at the start, from the left wall."""
    y_cm: Number
    """y of the centre at the start, from the lower wall."""
    radius_cm: Positive
    """Radius."""
    mass_kg: Positive
    """Mass."""
    friction: Annotated[Number, Field(ge=0, le=10)]
    """Coefficient of friction between it and the floor: what it takes to move it is this times its weight."""


class ArenaSection(ConfigModel):
    """The walled rectangle and what stands in it."""

    later_keys: ClassVar[tuple[str, ...]] = ("movables",)

    width_cm: Annotated[Positive, Field(ge=2 * epuck.RADIUS_CM)] = 60.0
    """Length of the floor along x; L of thesis 4.2.1, where the arena is square."""
    height_cm: Annotated[Positive, Field(ge=2 * epuck.RADIUS_CM)] = 60.0
    """Length of the floor along y."""
    obstacles: tuple[Annotated[Circle | Box | Polygon, Field(discriminator="shape")], ...] = ()
    movables: tuple[Movable, ...] = ()
    """What robots can push: as high as they are, so that it hides rings and is seen by infrared sensors."""

    @model_validator(mode="after")
    def _check_obstacles_inside(self) -> "ArenaSection":
        arena = self.build()
        extents = [(circle[:2] - circle[2], circle[:2] + circle[2]) for circle in arena.circles]
        extents += [(corners.min(axis=0), corners.max(axis=0)) for corners in arena.polygons]
        for low, high in extents:
            if (low < -1e-9).any() or (high > np.array([self.width_cm, self.height_cm]) + 1e-9).any():
                raise ValueError(
                    f"an obstacle or movable reaches from ({low[0]:g}, {low[1]:g}) to ({high[0]:g}, {high[1]:g}) cm, "
                    f"beyond the walls of the {self.width_cm:g} x {self.height_cm:g} cm arena"
                )
        return self

    @model_validator(mode="after")
    def _check_movables_free(self) -> "ArenaSection":
        for number, movable in enumerate(self.movables):
            others = self.model_copy(update={"movables": self.movables[:number]}).build()
            gap_cm = clearance_cm(others, movable.x_cm, movable.y_cm) - movable.radius_cm
            if gap_cm < -1e-9:
                raise ValueError(
                    f"movables.{number} overlaps an obstacle or an earlier movable by {-gap_cm:.3g} cm; allowed: they "
                    "may touch"
                )
        return self

    def build(self) -> Arena:
        """Return the arena as arrays."""
        circles = [(o.x_cm, o.y_cm, o.radius_cm) for o in self.obstacles if isinstance(o, Circle)]
        polygons = [
            np.array(o.corners_cm)
            if isinstance(o, Polygon)
            else box_corners(o.x_cm, o.y_cm, o.width_cm, o.height_cm, o.heading_rad)
            for o in self.obstacles
            if not isinstance(o, Circle)
        ]
        movables = [(m.x_cm, m.y_cm, m.radius_cm, 1000 * m.mass_kg, m.friction) for m in self.movables]
        return make_arena(self.width_cm, self.height_cm, circles, polygons, movables)
