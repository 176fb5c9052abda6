"""Claims as data: what is claimed, the sweep on which it is tested, and its tests; read from YAML.

A test is of trials, or of a number that follows from the thesis's equations.
"""

import math
import re
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, Field, ValidationError

from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber, problems_in
from epuck_sim.user_files import Kind
from epuck_sim.util.messages import comma_list, did_you_mean
from epuck_sim.util.yaml_io import read_yaml

CLAIMS = Kind(
    noun="claim",
    error=EpuckSimError,
    suffixes=(".yaml",),
    group="epuck_sim.claims",
    shipped=lambda: {"thesis": Path(__file__).with_name("claims.yaml")},
)
"""How files of claims are found."""

RISE = 1.1
"""Ratio of means above which T_sync rises, and below which it does not, in all claims: the base case has 1.17."""

Line = Annotated[str, AfterValidator(lambda text: " ".join(text.split()))]  # a cell of a table
Text = Annotated[Line, Field(min_length=1)]
Values = dict[str, Any]  # values of axes of a sweep, by dotted key
Law = Literal["Weibull", "gamma", "log-normal"]  # a distribution of T_sync

THRESHOLD = 0.95  # threshold of eq. 3.4 for robots (section 3.3), and of eq. C.2

FORMULAS = {
    # how far one of 20 robots (3.3) may be from the others, in cycles, at the threshold (eq. 3.4)
    "largest_shift": math.acos(1 - 20 * (1 - THRESHOLD)) / (2 * math.pi),
    # phase phi, in cycles, below which a pulse, which takes it to 1.1 phi (5.1), lowers the order parameter of two
    # oscillators (eq. 5.8): where phi and 1.1 phi add up to a cycle, their |cos(pi phi)| is equal
    "order_zero": 1 / 2.1,
    # how early or late, in s, two halves of a swarm of period 5 s (4.3) fire there (eq. C.2, its fraction inverted)
    "sigma_a": 5.0 * math.acos(THRESHOLD) / (2 * math.pi),
    # bound of eq. C.3, in frames, with 1 squared inside N / 2 where the text has 1 ^ 1 outside of it
    "sigma_b": math.sqrt(2 / 5 * sum(frame**2 for frame in (4, 3, 2, 1)) / 2),
}
"""Numbers that follow from the thesis's equations."""


class Test(NamedTuple):
    """A test that claims may name."""

    takes: tuple[str, ...]  # keys that it needs beside its prediction
    text: str  # template of the effect that it looks at
    points: int | None = None  # number of points that it takes; None for any


TESTS = {
    "ratio": Test(("between",), "{what} at {second} over {first}"),
    "largest_rise": Test(("along",), "largest rise of {what} with {along}"),
    "level": Test((), "{what}", 1),
    "share": Test((), "share {measure}", 1),
    "share_difference": Test(("between",), "share {measure} at {second} minus {first}", 2),
    "superiority": Test(("between",), "chance that {what} is larger at {second} than at {first}", 2),
    "power_exponent": Test(("along",), "power of {along} in {what}"),
    "exponential_rate": Test(("along",), "c of exp(c {along}) in {what}"),
    "rank_trend": Test(("along",), "rank correlation of {what} with {along}"),
    "likelier": Test(
        ("law", "than"), "nats a trial by which {law} distributions make {what} likelier than {than} ones"
    ),
    "weibull_ratio": Test(("censored_at",), "Weibull mean of {what}, censored at {censored_at:g}, over the mean", 1),
    "place_exponent": Test(("place", "along", "over"), "power of {over} in {place}"),
    "collapse": Test(("along", "of"), "distance of curves of T_sync over {measure}, relative to that over {along}"),
    "formula": Test(("number",), "{number}"),
}
"""All tests; `verdicts.EFFECTS` has the functions that run them."""

OF_T_SYNC = ("weibull_ratio", "place_exponent")  # tests of T_sync alone


class Check(ConfigModel):
    """A test of a claim, with one of its predictions, and the keys that it takes."""

    test: str
    above: Number | None = None  # the effect is larger than this
    below: Number | None = None  # the effect is smaller than this
    within: tuple[Number, Number] | None = None  # the effect lies between these two
    rises: bool | None = None  # of ratios of means: whether the ratio is above `RISE`
    where: Values = Field(default_factory=dict)  # values of axes that the points of the test have
    of: str | None = None  # measure that is tested; T_sync by default
    take: Literal["first", "final", "mean", "largest", "growth"] | None = None
    """Which of a series's values stands for a trial; `growth`: the slope of its logarithm over cycles."""
    between: tuple[Values, Values] = ({}, {})  # two places; a ratio pairs points that agree in all other axes
    along: str = ""  # axis along which means change, or curves are drawn
    over: str = ""  # axis in which curves differ
    place: Literal["V_m", "T_m", "V_p", "T_p", "V_f"] = "V_m"  # place on each curve
    law: Law = "Weibull"
    than: Law = "Weibull"  # law that is less likely
    censored_at: Positive = 1.0  # limit, cycles, as if trials were censored there
    number: str = ""  # number that follows from the thesis's equations

    @property
    def predicted(self) -> tuple[float | None, float | None]:
        """Bounds of the predicted effect, low and high; None where it has none."""
        if self.rises is not None:
            return (RISE, None) if self.rises else (None, RISE)
        return self.within or (self.above, self.below)

    def _check_together(self) -> None:
        self._check_keys()
        self._check_prediction()

    def _check_keys(self) -> None:
        for key, known in (("test", TESTS), ("number", FORMULAS if self.test == "formula" else [self.number])):
            if (given := getattr(self, key)) not in known:
                raise ValueError(f"{key}: {did_you_mean(given, known)}; allowed: {comma_list(known)}")
        takes = TESTS[self.test].takes
        others = {"formula": (), **dict.fromkeys(OF_T_SYNC, ("where",))}.get(self.test, ("where", "of", "take"))
        rises = ("rises",) if self.test in ("ratio", "largest_rise") else ()
        for key in type(self).model_fields:
            is_given = key in self.model_fields_set
            if key in takes and not is_given:
                raise ValueError(f"{key} is missing; {self.test} takes {comma_list([*takes])}")
            if is_given and key not in ("test", "above", "below", "within", *takes, *others, *rises):
                raise ValueError(f"unknown key {key!r}; {self.test} takes {comma_list([*takes, *others])}")
        if sum(getattr(self, key) is not None for key in ("above", "below", "within", "rises")) != 1:
            raise ValueError("give one of above, below and within")

    def _check_prediction(self) -> None:
        if self.within is not None and self.within[0] >= self.within[1]:
            raise ValueError("within: the first number must be the lower one")
        if self.test == "share_difference" and any(self.predicted):
            raise ValueError("a difference of shares is tested against 0: give above: 0 or below: 0")
        thresholds = [each for each in self.predicted if each is not None]
        if self.test == "rank_trend" and not all(-1 < each < 1 for each in thresholds):
            raise ValueError("a correlation lies between -1 and 1")
        if self.test in ("share", "superiority") and not all(0 <= each <= 1 for each in thresholds):
            raise ValueError("a share, or a chance, lies between 0 and 1")
        if self.test in ("ratio", "largest_rise", "weibull_ratio") and min(thresholds) <= 0:
            raise ValueError("a ratio of means lies above 0: give numbers above 0")
        if self.test == "likelier" and self.law == self.than:
            raise ValueError(f"than is {self.than}, as law is; allowed: another law")
        if self.take is not None and self.of is None:
            raise ValueError("take is given without of, the measure whose values it takes")
        if "between" in TESTS[self.test].takes and self.between[0] == self.between[1]:
            raise ValueError("between has the same place twice; give two that differ")


class AskedSweep(ConfigModel):
    """A sweep on which claims are tested."""

    scenario: Text  # a shipped scenario, or a YAML file
    keys: dict[str, Any] = Field(default_factory=dict)  # keys that differ from the scenario's, as in its `quick`


class Claim(ConfigModel):
    """A claim of the thesis: it holds if all its checks do."""

    id: Text
    section: Text
    claim: Text  # what is claimed, in our words
    quote: Line = ""  # the sentence that claims it, word for word; what is left out is marked by `...`
    line: Annotated[WholeNumber, Field(ge=1)] | None = None  # line of the sentence in the text
    quantifier: str = ""  # how much the sentence claims: always, some, only if
    source: Line = ""  # paper whose result the sentence quotes
    sweep: str | None = None  # name of the sweep of all its checks, except those of formulas
    checks: tuple[Check, ...] = ()
    reading: str = ""  # the part of its tests that is ours: they then decide about our reading, not about the claim
    otherwise: str = ""  # reading of the text that would change the verdict
    changed: str = ""  # changes of its tests after first results, and why
    identity: Line = ""  # why it cannot fail
    no_claim: Line = ""  # why there is nothing to test
    not_asked: Line = ""  # why it is not tested

    def _check_together(self) -> None:
        reasons = sum(map(bool, (self.identity, self.no_claim, self.not_asked)))
        has_tests = bool(self.checks) and not self.identity
        if has_tests + reasons != 1 or (self.reading and not has_tests):
            raise ValueError("give either checks, which may be a reading, or one of identity, no_claim and not_asked")
        if (self.sweep is None) == any(check.test != "formula" for check in self.checks):
            raise ValueError("give sweep where checks test trials, and only there")


class Claims(ConfigModel):
    """All claims of a file, and their sweeps by name."""

    seed: WholeNumber = 0  # seed of sweeps whose keys have none
    pooled: str = ""  # which trials count, and which do not
    sweeps: dict[str, AskedSweep] = Field(default_factory=dict)
    claims: Annotated[tuple[Claim, ...], Field(min_length=1)]
    notes: tuple[Text, ...] = ()
    """Notes at the page's end: contradictions within the text, misprints, identities that it takes for findings."""

    def _check_together(self) -> None:
        names = [claim.id for claim in self.claims]
        for name in (*names, *self.sweeps):
            if not re.fullmatch(r"\w[\w.-]*", name):  # names of files and folders contain them
                raise ValueError(f"{name!r} is no name of a claim, or of a sweep; allowed: letters, digits, _, - and .")
        for claim in self.claims:
            if names.count(claim.id) > 1:
                raise ValueError(f"claim {claim.id} is given twice")
            if claim.sweep is not None and claim.sweep not in self.sweeps:
                raise ValueError(f"claim {claim.id}: sweep: {did_you_mean(claim.sweep, dict(self.sweeps))}")

    def choose(self, names: tuple[str, ...]) -> tuple[Claim, ...]:
        """Return the claims of these ids, or all, in the order of the file; raise EpuckSimError if one is not there."""
        known = {claim.id: claim for claim in self.claims}
        for name in names:
            if name not in known:
                raise EpuckSimError(f"{did_you_mean(name, known)}; claims: {comma_list(known)}")
        return tuple(claim for claim in self.claims if not names or claim.id in names)


def read_claims(name: str | Path = "thesis") -> Claims:
    """Read claims from a YAML file, or those that the thesis or a package has; files of scenarios may lie beside them.

    EpuckSimError is raised with the first mistake in the file: file, claim, by its id, key, and what is allowed.
    """
    path = CLAIMS.locate(str(name)).path or Path()
    given = read_yaml(path)
    try:
        claims = Claims.model_validate(given)
    except ValidationError as error:
        _, said = next(problems_in(Claims, error))
        if in_claim := re.match(r"claims\.(\d+)", said):
            claim, number = given["claims"][int(in_claim[1])], in_claim[1]
            said = f"{claim.get('id', number) if isinstance(claim, dict) else number}{said[in_claim.end() :]}"
        raise EpuckSimError(f"{name}: {said}") from error
    sweeps = dict(claims.sweeps)
    for sweep, asked in claims.sweeps.items():
        if (file := path.parent / asked.scenario).is_file():
            sweeps[sweep] = asked.model_copy(update={"scenario": str(file)})
    return claims.model_copy(update={"sweeps": sweeps})
