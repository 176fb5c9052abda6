"""The checks of a claim as data: a test, the points that it looks at, and what is predicted of its effect."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from epuck_sim.replication.formulas import FORMULAS
from epuck_sim.scenario.base import ConfigModel, Number
from epuck_sim.util.messages import comma_list, did_you_mean

Values = dict[str, Any]
"""Values of axes of a sweep, by dotted key."""


class _Check(ConfigModel):
    """A test of a claim: it has one of three predictions about an effect."""

    above: Number | None = None
    """The effect is larger than this."""
    below: Number | None = None
    """The effect is smaller than this."""
    within: tuple[Number, Number] | None = None
    """The effect lies between these two."""

    @model_validator(mode="after")
    def _has_one_prediction(self) -> "_Check":
        if sum(each is not None for each in (self.above, self.below, self.within)) != 1:
            raise ValueError("give one of above, below and within")
        if self.within is not None and self.within[0] >= self.within[1]:
            raise ValueError("within: the first number must be the lower one")
        return self


class _SweepCheck(_Check):
    where: Values = Field(default_factory=dict)
    """Values of axes that the points of the test have."""
    of: str | None = None
    """Measure that is tested; T_sync by default."""
    take: Literal["first", "final", "mean", "largest"] | None = None
    """Which of a series's values stands for a trial."""


class RatioCheck(_SweepCheck):
    """Of the mean at the second of two places over that at the first; their points are paired in the sweep's order."""

    test: Literal["ratio"]
    between: tuple[Values, Values]


class RiseCheck(_SweepCheck):
    """Of the largest ratio of the mean at a point over that at one before it, along an axis."""

    test: Literal["largest_rise"]
    along: str


class LevelCheck(_SweepCheck):
    """Of the mean at one point."""

    test: Literal["level"]


class ShareCheck(_SweepCheck):
    """Of the share of trials at one point that are synchronised, or in which a truth value is true."""

    test: Literal["share"]


class PowerCheck(_SweepCheck):
    """Of the exponent of the power of an axis that the mean follows."""

    test: Literal["power_exponent"]
    along: str


class RateCheck(_SweepCheck):
    """Of the rate c with which the mean grows as exp(c x) along an axis."""

    test: Literal["exponential_rate"]
    along: str


class FormulaCheck(_Check):
    """Of a number that follows from the thesis's equations."""

    test: Literal["formula"]
    number: str

    @model_validator(mode="after")
    def _is_known(self) -> "FormulaCheck":
        if self.number not in FORMULAS:
            raise ValueError(f"number: {did_you_mean(self.number, dict(FORMULAS))}; allowed: {comma_list(FORMULAS)}")
        return self


SweepCheck = RatioCheck | RiseCheck | LevelCheck | ShareCheck | PowerCheck | RateCheck
Check = Annotated[SweepCheck | FormulaCheck, Field(discriminator="test")]

TESTS = ("ratio", "largest_rise", "level", "share", "power_exponent", "exponential_rate", "formula")
"""Names of all tests."""
