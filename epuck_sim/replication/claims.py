"""Claims as data: what is claimed, the sweep that asks it, and its tests; read from YAML."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator

from epuck_sim.errors import EpuckSimError
from epuck_sim.replication.checks import TESTS, Check
from epuck_sim.scenario.base import ConfigModel, WholeNumber
from epuck_sim.scenario.yaml_io import read_yaml
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

SHIPPED = Path(__file__).with_name("claims.yaml")
"""The claims of the thesis."""

Text = Annotated[str, Field(min_length=1)]


class AskedSweep(ConfigModel):
    """A sweep that claims are asked of, in two versions."""

    scenario: Text
    """A shipped scenario, or a YAML file."""
    keys: dict[str, Any] = Field(default_factory=dict)
    """Keys in which both versions differ from it, as in a scenario's `quick`."""
    quick: dict[str, Any] | None = None
    """Further keys of the quick version; without any the full version alone is asked."""
    full: dict[str, Any]
    """Further keys of the full version."""


class Claim(ConfigModel):
    """A claim of the thesis: it holds if all its checks do."""

    id: Text
    section: Text
    claim: Text
    """What is claimed, in our words."""
    quote: str = ""
    """The sentence that claims it, word for word; what is left out is marked by `...`."""
    line: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Line of the sentence in the text."""
    quantifier: str = ""
    """How much the sentence claims: always, some, only if."""
    source: str = ""
    """Paper whose result the sentence quotes."""
    sweep: str | None = None
    """Name of the sweep that all its checks are asked of, but those of formulas."""
    checks: tuple[Check, ...] = ()
    reading: str = ""
    """What of its tests is ours: then they decide about our reading, and not about the claim."""
    otherwise: str = ""
    """Reading of the text that would change the verdict."""
    changed: str = ""
    """What of its tests was changed after first results, and why."""
    identity: str = ""
    """Why it cannot fail."""
    no_claim: str = ""
    """Why there is nothing to test."""
    not_asked: str = ""
    """Why it is not asked."""

    @property
    def untested(self) -> str:
        """Why no test of trials decides about it; empty if one does."""
        return self.identity or self.no_claim or self.not_asked

    @model_validator(mode="after")
    def _is_asked_or_not(self) -> "Claim":
        reasons = sum(map(bool, (self.identity, self.no_claim, self.not_asked)))
        has_tests = bool(self.checks) and not self.identity
        if has_tests + reasons != 1 or (self.reading and not has_tests):
            raise ValueError("give either checks, which may be a reading, or one of identity, no_claim and not_asked")
        if (self.sweep is None) == any(check.test != "formula" for check in self.checks):
            raise ValueError("tests of trials take a sweep, and only these")
        return self


class Claims(ConfigModel):
    """All claims of a file, and their sweeps by name."""

    seed: WholeNumber = 0
    """Seed of all sweeps."""
    pooled: str = ""
    """Which trials count, and which do not."""
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
