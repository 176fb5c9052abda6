"""Point-like agents: how many they are, how fast, and when they turn (thesis 5.1.2, 6.2, D.1)."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber
from epuck_sim.scenario.walks import WalkSection

_SPEED_NEEDS = {
    "fixed": {},
    "uniform": {"speed_spread": "above 0 and up to 1"},
    "normal": {"speed_spread": "above 0 and up to 1"},
    "exponential": {},
    "lognormal": {"speed_spread": "above 0 and up to 2"},
    "two_speeds": {"fast_share": "above 0 and below 1", "fast_ratio": "above 1 and up to 1000"},
}
"""The keys that each distribution of speeds needs, and what they may be; it takes no others."""


class AgentsSection(ConfigModel):
    """Number of agents, and how they move."""

    later_keys: ClassVar[tuple[str, ...]] = ("walk", "speed_per_run", "fast_share", "fast_ratio")

    count: Annotated[WholeNumber, Field(ge=1, le=100_000)] = 20
    """Number N of agents."""
    speed_cm_s: Annotated[Number, Field(ge=0, le=1e6)] = 1.0
    """Speed of each agent, or the mean of the distribution of speeds."""
    speed_distribution: Literal["fixed", "uniform", "normal", "exponential", "lognormal", "two_speeds"] = "fixed"
    """Distribution from which the speed of each agent is drawn, once a trial (thesis 6.2)."""
    speed_spread: Annotated[Number, Field(gt=0, le=2)] | None = None
    """Half-width of `uniform`, or standard deviation of `normal` and `lognormal`, relative to the mean; `normal` is cut
    at 0 and 2."""
    fast_share: Annotated[Number, Field(gt=0, lt=1)] | None = None
    """Chance of each agent of `two_speeds` to be a fast one."""
    fast_ratio: Annotated[Number, Field(gt=1, le=1000)] | None = None
    """Speed of the fast agents of `two_speeds` relative to that of the slow ones."""
    speed_per_run: bool = False
    """Whether an agent draws a new speed at the end of each run of its walk, instead of keeping its first one."""
    walk: WalkSection = WalkSection()
    reorient_on: tuple[Literal["emitting", "receiving", "arriving"], ...] = ()
    """Pulses at which an agent turns to a random direction (D.1): those that it emits, those that shift its phase, or
    all that arrive."""

    @model_validator(mode="after")
    def _check_speeds(self) -> "AgentsSection":
        needed = _SPEED_NEEDS[self.speed_distribution]
        for key in ("speed_spread", "fast_share", "fast_ratio"):
            is_given = getattr(self, key) is not None
            if is_given != (key in needed):
                what = f"takes no {key}; leave it out" if is_given else f"needs a {key}, {needed[key]}"
                raise ValueError(f"speed_distribution {self.speed_distribution!r} {what}")
        if self.speed_distribution != "lognormal" and (self.speed_spread or 0) > 1:
            raise ValueError(f"speed_spread is {self.speed_spread:g}; allowed: {needed['speed_spread']}")
        if self.speed_per_run and (self.walk.kind == "straight" or self.speed_distribution == "fixed"):
            raise ValueError(
                f"speed_per_run is true, walk.kind is {self.walk.kind!r} and speed_distribution is "
                f"{self.speed_distribution!r}; it needs runs that end, and speeds that differ"
            )
        return self
