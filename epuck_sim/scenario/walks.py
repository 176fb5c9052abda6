"""The random walk of point-like agents: how long they keep a direction, and how they turn (thesis 6.2)."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, Positive

_NEEDS = {
    "straight": (),
    "brownian": ("run_s",),
    "correlated": ("run_s", "persistence"),
    "levy": ("run_s", "exponent"),
}
"""The keys that each kind of walk needs; it takes no others."""


class WalkSection(ConfigModel):
    """How agents move between walls: straight ahead, or in straight runs with a turn at the end of each.

    A wall ends no run: what is left of it goes on behind the wall.
    """

    kind: Literal["straight", "brownian", "correlated", "levy"] = "straight"
    """`straight`: no turns; `brownian`: runs of exponential duration, any new direction; `correlated`: the same, but
    the new direction is drawn around the old one; `levy`: durations with a power law, any new direction."""
    run_s: Positive | None = None
    """Mean duration of a run; of a `levy` walk the shortest, as the mean is infinite up to an exponent of 2."""
    persistence: Annotated[Number, Field(ge=0, le=1)] | None = None
    """Mean cosine g of the turns of a `correlated` walk; 0 makes it `brownian`, 1 never turns."""
    exponent: Annotated[Number, Field(gt=1, le=3)] | None = None
    """Exponent mu of a `levy` walk: the density of durations falls as their power of -mu, the share of longer ones as
    that of 1 - mu."""

    @model_validator(mode="after")
    def _check_keys(self) -> "WalkSection":
        needed = _NEEDS[self.kind]
        for key in ("run_s", "persistence", "exponent"):
            is_given = getattr(self, key) is not None
            if is_given != (key in needed):
                what = f"takes no {key}; leave it out" if is_given else f"needs {' and '.join(needed)}"
                raise ValueError(f"kind {self.kind!r} {what}")
        return self
