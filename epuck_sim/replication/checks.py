"""The checks of a claim as data: a test, the points that it looks at, and what is predicted of its effect."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from epuck_sim.replication.formulas import FORMULAS
from epuck_sim.scenario.base import ConfigModel, Number
from epuck_sim.util.messages import comma_list, did_you_mean

Values = dict[str, Any]
"""Values of axes of a sweep, by dotted key."""

Law = Literal["Weibull", "gamma", "log-normal"]
"""A distribution of T_sync."""


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


class SuperiorityCheck(_SweepCheck):
    """Of the probability that a trial at the second of two places takes longer than one at the first."""

    test: Literal["superiority"]
    between: tuple[Values, Values]


class TrendCheck(_SweepCheck):
    """Of the rank correlation of trials with an axis."""

    test: Literal["rank_trend"]
    along: str

    @model_validator(mode="after")
    def _is_a_correlation(self) -> "TrendCheck":
        if not all(-1 < each < 1 for each in (self.above, self.below, *(self.within or ())) if each is not None):
            raise ValueError("a correlation lies between -1 and 1")
        return self


class LikelierCheck(_SweepCheck):
    """Of how much likelier a distribution makes trials than another, in nats a trial."""

    test: Literal["likelier"]
    law: Law
    than: Law


class PlaceCheck(_SweepCheck):
    """Of the exponent of the power of an axis that a place of curves follows: a minimum, a peak or the fast regime."""

    test: Literal["place_exponent"]
    place: Literal["V_m", "T_m", "V_p", "T_p", "V_f"]
    along: str
    """Speed, the axis of the curves."""
    over: str
    """Axis in which the curves differ."""


class CollapseCheck(_SweepCheck):
    """Of how far curves of T_sync are apart over the measure `of`, over how far they are apart along an axis."""

    test: Literal["collapse"]
    along: str
    of: str


class FormulaCheck(_Check):
    """Of a number that follows from the thesis's equations."""

    test: Literal["formula"]
    number: str

    @model_validator(mode="after")
    def _is_known(self) -> "FormulaCheck":
        if self.number not in FORMULAS:
            raise ValueError(f"number: {did_you_mean(self.number, dict(FORMULAS))}; allowed: {comma_list(FORMULAS)}")
        return self


SweepCheck = (
    RatioCheck
    | RiseCheck
    | LevelCheck
    | ShareCheck
    | PowerCheck
    | RateCheck
    | SuperiorityCheck
    | TrendCheck
    | LikelierCheck
    | PlaceCheck
    | CollapseCheck
)
Check = Annotated[SweepCheck | FormulaCheck, Field(discriminator="test")]

TESTS = tuple(each.model_fields["test"].annotation.__args__[0] for each in (*SweepCheck.__args__, FormulaCheck))
"""Names of all tests."""
