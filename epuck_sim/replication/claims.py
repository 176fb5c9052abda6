"""Claims as data: what is claimed, the sweep that asks it, and the tests with their thresholds; read from YAML."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from epuck_sim.errors import EpuckSimError
from epuck_sim.replication.formulas import FORMULAS
from epuck_sim.scenario.base import ConfigModel, Number
from epuck_sim.scenario.yaml_io import read_yaml
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

SHIPPED = Path(__file__).with_name("claims.yaml")
"""The claims of the thesis."""

Text = Annotated[str, Field(min_length=1)]
Values = dict[str, Any]
"""Values of axes of a sweep, by dotted key."""


class AskedSweep(ConfigModel):
    """A sweep that claims are asked of, in two versions."""

    scenario: Text
    """A shipped scenario, or a YAML file."""
    keys: dict[str, Any] = Field(default_factory=dict)
    """Keys in which both versions differ from it, as in a scenario's `quick`."""
    quick: dict[str, Any]
    """Further keys of the quick version."""
    full: dict[str, Any]
    """Further keys of the full version."""


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
    """Of the mean at the second of two places over that at the first, over all that they share."""

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


class Claim(ConfigModel):
    """A claim of the thesis: it holds if all its checks do."""

    id: Text
    section: Text
    claim: Text
    """What is claimed, in our words."""
    says: Text
    """The thesis's number or word."""
    sweep: str | None = None
    """Name of the sweep that all its checks are asked of, but those of formulas."""
    checks: tuple[Check, ...] = ()
    otherwise: str = ""
    """Reading of the text that would change the verdict."""
    not_asked: str = ""
    """Why it is not asked."""

    @model_validator(mode="after")
    def _is_asked_or_not(self) -> "Claim":
        if bool(self.checks) == bool(self.not_asked):
            raise ValueError("give either checks or not_asked")
        if (self.sweep is None) == any(check.test != "formula" for check in self.checks):
            raise ValueError("tests of trials take a sweep, and only these")
        return self


class Claims(ConfigModel):
    """All claims of a file, and their sweeps by name."""

    sweeps: dict[str, AskedSweep] = Field(default_factory=dict)
    claims: Annotated[tuple[Claim, ...], Field(min_length=1)]
    notes: tuple[Text, ...] = ()
    """What the page ends with: contradictions within the text, misprints, identities that it takes for findings."""

    @model_validator(mode="after")
    def _names_agree(self) -> "Claims":
        names = [claim.id for claim in self.claims]
        for claim in self.claims:
            if names.count(claim.id) > 1:
                raise ValueError(f"claim {claim.id} is there twice")
            if claim.sweep is not None and claim.sweep not in self.sweeps:
                raise ValueError(f"claim {claim.id}: sweep: {did_you_mean(claim.sweep, dict(self.sweeps))}")
        return self

    def choose(self, names: tuple[str, ...]) -> tuple[Claim, ...]:
        """Return the claims of these ids, in the order of the file; all if none is named.

        Raises:
            EpuckSimError: There is no such claim.
        """
        known = {claim.id: claim for claim in self.claims}
        for name in names:
            if name not in known:
                raise EpuckSimError(f"{did_you_mean(name, known)}; claims: {comma_list(known)}")
        return tuple(claim for claim in self.claims if not names or claim.id in names)


def read_claims(path: Path = SHIPPED) -> Claims:
    """Read claims from a YAML file, those of the thesis by default.

    Raises:
        EpuckSimError: The file cannot be read, or is wrong; the message names the file, the key and what is allowed.
    """
    given = read_yaml(path)
    try:
        return Claims.model_validate(given)
    except ValidationError as error:
        raise EpuckSimError(_message(path, given, error)) from error


def _message(path: Path, given: Any, error: ValidationError) -> str:
    """Return pydantic's first error as file: claim: key: what is wrong."""
    detail = error.errors()[0]
    location = [part for part in detail["loc"] if part not in TESTS]
    if location[:1] == ["claims"] and len(location) > 1:  # a claim is found by its id
        claim = given["claims"][location[1]]
        location[:2] = [claim.get("id", location[1]) if isinstance(claim, dict) else location[1]]
    what = detail["msg"].removeprefix("Value error, ")
    if detail["type"] == "extra_forbidden":
        what = f"unknown key {location[-1]!r}"
    elif detail["type"] not in ("missing", "value_error"):
        what = f"is {short_repr(detail['input'])}; {what[0].lower()}{what[1:]}"
    return ": ".join(part for part in (str(path), ".".join(map(str, location)), what) if part)
