"""The physics of a trial of robots: contacts, rates of control and of bodies, and how robots differ from ideal ones."""

from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber


class ContactSection(ConfigModel):
    """What happens where bodies touch; by default they slide past each other (thesis 3.1.4.1)."""

    later_keys: ClassVar[tuple[str, ...]] = ("robots", "drive_force_n")

    friction: Annotated[Number, Field(ge=0, le=10)] = 0.0
    """Coefficient of friction between bodies."""
    robots: bool = True
    """Whether robots touch each other; else they touch walls, obstacles and movables only."""
    drive_force_n: Positive = 0.5
    """Largest force in newtons with which wheels drive or hold a robot where there are `arena.movables`; our estimate:
    the friction of wheels that bear about two thirds of the weight. Elsewhere, wheels set velocities."""


class TimingSection(ConfigModel):
    """How often robots sense and act, and how often bodies move (thesis 3.1.4.1)."""

    control_hz: Annotated[WholeNumber, Field(ge=1, le=1000)] = 10
    """Control steps a second, in each of which every robot senses and acts once."""
    physics_hz: Annotated[WholeNumber, Field(ge=100, le=10_000)] = 100
    """Physics steps a second; with fewer than 100, bodies would overlap by more than 1 mm before a contact is found."""

    @model_validator(mode="after")
    def _check_rates(self) -> "TimingSection":
        if 1000 % self.control_hz:
            raise ValueError(
                f"control_hz is {self.control_hz}; a control step must be whole milliseconds: 1, 2, 4, 5, "
                "8, 10, 20, 25, 40, 50, 100, 125, 200, 250, 500 or 1000"
            )
        if self.physics_hz % self.control_hz:
            raise ValueError(f"physics_hz is {self.physics_hz}; allowed: a multiple of control_hz, {self.control_hz}")
        return self

    @property
    def step_ms(self) -> int:
        """Milliseconds from one control step to the next."""
        return 1000 // self.control_hz


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
