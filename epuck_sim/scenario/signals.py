"""How flashes reach the robots of a group: the section `signal` of a group in a scenario."""

from typing import Annotated, Literal

from pydantic import Field

from epuck_sim.scenario.base import ConfigModel, Number, Positive


class CameraSignal(ConfigModel):
    """By the line camera that the group's section `camera` describes (thesis 4.1.1)."""

    kind: Literal["camera"] = "camera"


class ConeSection(ConfigModel):
    """A circular sector with a robot's centre as its apex (thesis 3.1.2); a disc by default."""

    range_cm: Positive | None = None
    """Radius; unlimited by default."""
    angle_deg: Annotated[Number, Field(gt=0, le=360)] = 360.0
    """Full opening angle, half of it to either side of straight ahead."""
    of: Literal["vision", "emission"] = "vision"
    """Whose cone it is: the receiver's, in which the sender lies, or the sender's, in which the receiver lies."""


class ConeSignal(ConeSection):
    """By an ideal sensor, which knows the lit rings whose centres lie in a cone (thesis 3.1.2, 3.1.4.3)."""

    kind: Literal["cone"]
    occlusion: bool = True
    """Whether other robots and obstacles hide a ring: they block the line between the two robots' centres."""


class RadioSignal(ConeSection):
    """By radio pulses, which nothing blocks (thesis 6.2)."""

    kind: Literal["radio"]
    latency_ms: Annotated[Number, Field(ge=0, le=60_000)] = 0.0
    """Time by which pulses are late; a pulse arrives in the first control step that begins so much later."""
    loss: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Probability with which a robot misses a pulse, for each pulse and robot alone."""
    collisions: bool = False
    """Whether a robot that several pulses reach at once receives none of them."""
    half_duplex: bool = False
    """Whether a robot receives nothing in a control step in which it sends."""


SignalSection = Annotated[CameraSignal | ConeSignal | RadioSignal, Field(discriminator="kind")]
