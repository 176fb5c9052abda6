"""The checks of a claim as data: a test, the points that it looks at, and what is predicted of its effect."""

from typing import Annotated, Any, Literal, get_args

from pydantic import Field, model_validator

from epuck_sim.replication.formulas import FORMULAS
from epuck_sim.scenario.base import ConfigModel, Number, Positive
from epuck_sim.util.messages import comma_list, did_you_mean

RISE = 1.1
"""Ratio of means above which T_sync rises, and below which it does not, in all claims: the base case has 1.17."""

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

    @property
    def predicted(self) -> tuple[float | None, float | None]:
        """What the effect is above, and what it is below."""
        return self.within or (self.above, self.below)

    @model_validator(mode="after")
    def _has_one_prediction(self) -> "_Check":
        if sum(getattr(self, key, None) is not None for key in ("above", "below", "within", "rises")) != 1:
            raise ValueError("give one of above, below and within")
        if self.within is not None and self.within[0] >= self.within[1]:
            raise ValueError("within: the first number must be the lower one")
        return self


class _SweepCheck(_Check):
    where: Values = Field(default_factory=dict)
    """Values of axes that the points of the test have."""
    of: str | None = None
    """Measure that is tested; T_sync by default."""
    take: Literal["first", "final", "mean", "largest", "growth"] | None = None
    """Which of a series's values stands for a trial; `growth`: the slope of its logarithm over cycles."""


class _MeansCheck(_SweepCheck):
    rises: bool | None = None
    """Instead of above or below: whether the ratio is above `RISE`."""

    @property
    def predicted(self) -> tuple[float | None, float | None]:
        """What the ratio is above, and what it is below."""
        if self.rises is None:
            return super().predicted
        return (RISE, None) if self.rises else (None, RISE)


class RatioCheck(_MeansCheck):
    """Test of the mean at the second of two places over that at the first; points are paired in the sweep's order."""

    test: Literal["ratio"]
    between: tuple[Values, Values]


class RiseCheck(_MeansCheck):
    """Test of the largest ratio of the mean at a point over that at one before it, along an axis."""

    test: Literal["largest_rise"]
    along: str


class PointCheck(_SweepCheck):
    """Test of the mean at one point, or of the share of trials that are synchronised, or in which a measure is true."""

    test: Literal["level", "share"]


class PairCheck(_SweepCheck):
    """Test of two points: the second share minus the first, or the chance that a trial at the second is longer."""

    test: Literal["share_difference", "superiority"]
    between: tuple[Values, Values]

    @model_validator(mode="after")
    def _is_of_a_difference(self) -> "PairCheck":
        if self.test == "share_difference" and any(each for each in self.predicted):
            raise ValueError("a difference of shares is tested against 0: give above: 0 or below: 0")
        return self


class AlongCheck(_SweepCheck):
    """Test of how the mean goes along an axis x: as x^a, as exp(c x), or the rank correlation of trials with x."""

    test: Literal["power_exponent", "exponential_rate", "rank_trend"]
    along: str

    @model_validator(mode="after")
    def _is_a_correlation(self) -> "AlongCheck":
        if self.test == "rank_trend" and not all(-1 < each < 1 for each in self.predicted if each is not None):
            raise ValueError("a correlation lies between -1 and 1")
        return self


class LikelierCheck(_SweepCheck):
    """Test of how much likelier a distribution makes trials than another, in nats a trial."""

    test: Literal["likelier"]
    law: Law
    than: Law


class EstimatorCheck(_SweepCheck):
    """Test of the Weibull mean of the trials of a point as if they were censored at a limit, over their mean."""

    test: Literal["weibull_ratio"]
    censored_at: Positive
    """Limit, cycles."""


class PlaceCheck(_SweepCheck):
    """Test of the exponent of the power of an axis that the minimum, the peak or the fast regime of curves follows."""

    test: Literal["place_exponent"]
    place: Literal["V_m", "T_m", "V_p", "T_p", "V_f"]
    along: str
    """Speed, the axis of the curves."""
    over: str
    """Axis in which the curves differ."""


class CollapseCheck(_SweepCheck):
    """Test of how far curves of T_sync are apart over the measure `of`, over how far they are apart along an axis."""

    test: Literal["collapse"]
    along: str
    of: str


class FormulaCheck(_Check):
    """Test of a number that follows from the thesis's equations."""

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
    | PointCheck
    | PairCheck
    | AlongCheck
    | LikelierCheck
    | EstimatorCheck
    | PlaceCheck
    | CollapseCheck
)
Check = Annotated[SweepCheck | FormulaCheck, Field(discriminator="test")]

TESTS = tuple(
    name for kind in (*get_args(SweepCheck), FormulaCheck) for name in get_args(kind.model_fields["test"].annotation)
)
"""Names of all tests."""
