"""How robots differ from ideal ones: noise, spread between robots, and robots that get stuck."""

from typing import Annotated

from pydantic import Field

from epuck_sim.scenario.base import ConfigModel, Number, Positive


class NoiseSection(ConfigModel):
    """Noise of sensors and wheels; 0 switches one kind off, `noise: off` both."""

    wheel_speed: Annotated[Number, Field(ge=0, lt=1)] = 0.05
    """Half-width of the uniform factor around 1 by which each wheel's speed is multiplied in each step (Enki)."""
    infrared_counts: Annotated[Number, Field(ge=0, le=10_000)] = 10.0
    """Standard deviation of the noise on each infrared reading (Enki)."""


class SpreadSection(ConfigModel):
    """Differences between robots (thesis 4.4): half-widths of uniform factors around 1, drawn once a trial."""

    wheel_speed: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Spread of the speed of a robot's two wheels together."""
    wheel_imbalance: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Spread of the speed of each single wheel."""
    clock_rate: Annotated[Number, Field(ge=0, le=0.1)] = 0.0
    """Spread of the rate of the clock by which a robot's controller measures time."""
    infrared_gain: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Spread of the readings of each single infrared sensor."""


class StuckSection(ConfigModel):
    """How robots get stuck from time to time (thesis 4.4): their wheels turn but do not move them."""

    per_hour: Annotated[Number, Field(ge=0, le=3600)] = 0.0
    """Mean number of times in an hour of free motion; 0 for never."""
    mean_s: Positive = 20.0
    """Mean time in seconds until the robot is free again."""
