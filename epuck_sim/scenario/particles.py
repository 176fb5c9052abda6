"""A scenario of point-like agents: their space, start, motion, neighbourhoods, and how a pulse shifts a phase.

The defaults are those of thesis section 5.1: 20 agents in a square of side 100, nearest neighbours, the multiplicative
response curve. Its lengths have no unit and its period is 1; here they are centimetres and seconds, as in chapter 3.
`arenas/new/curve.py` shows a response curve in a user's file (thesis 2.4, 5.1.1).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, cast

from pydantic import BeforeValidator, Field

from epuck_sim.control.interface import RobotCode
from epuck_sim.control.loader import describe_code
from epuck_sim.control.names import check_draws
from epuck_sim.errors import CurveError, EpuckSimError, ScenarioError
from epuck_sim.scenario.base import LARGEST, ConfigModel, Length, Number, Positive, WholeNumber, check_range, refused_at
from epuck_sim.scenario.changes import NOT_OF_AGENTS, AgentScheduleEntry, AnyFault, check_changes, notes_on_faults
from epuck_sim.scenario.keys import set_values
from epuck_sim.scenario.scenario import Scenario, StopSection
from epuck_sim.user_files import Kind, Place, Value, by_attribute, kept, line_of_error, load_python_file
from epuck_sim.util.messages import short_repr

SHIPPED: Mapping[str, Mapping[str, Value]] = {
    "multiplicative": {},
    "sawtooth": {},
    "sine": {},
    "additive": {},
    "mirollo_strogatz": {"dissipation": 3.0},
    "piecewise_linear": {"knee": 0.5, "early_slope": 1.0},
}
"""Name and default of each parameter of the shipped curves, by their names."""

LIMITS = {"dissipation": (1e-3, 100.0), "knee": (0.0, 1.0), "early_slope": (-1000.0, 1000.0)}
"""Least and greatest value of the shipped curves' parameters."""

UP_TO_1 = ("sawtooth", "sine", "additive", "mirollo_strogatz")
"""Curves whose coupling is at most 1 (thesis 5.1.1; for the last two it is a share of the way to the threshold)."""

TRIED_PHASES = 100  # number of steps from phase 0 to 1 in which a user's curve is tried when a scenario is read


@dataclass(frozen=True, eq=False)
class Curve(RobotCode):
    """A response curve as a scenario names it."""

    phase_shift: Callable[[float, float, Any], float] | None = None  # the function of a user's file

    def check_values(self, values: Mapping[str, Value]) -> None:
        """Raise ValueError for parameters beyond the limits of a shipped curve."""
        for name, value in values.items() if self.phase_shift is None else ():
            check_range(name, cast("float", value), *LIMITS[name])

    def check_shift(self, phase: float, coupling: float, parameters: Mapping[str, Value]) -> None:
        """Call a user's function at a phase; raise CurveError if it raises, or returns no finite number."""
        assert self.phase_shift is not None
        try:
            shift = self.phase_shift(phase, coupling, by_attribute(parameters))
            is_number = not isinstance(shift, complex) and math.isfinite(shift)
        except Exception as error:  # whatever a user's file may raise
            where = line_of_error(error, self.sources) or self.path
            raise CurveError(f"{where}: at phase {phase:g}: {type(error).__name__}: {error}") from error
        if not is_number:
            raise CurveError(f"{self.path}: phase_shift returns {short_repr(shift)} at phase {phase:g}")


CURVE = Kind(
    noun="response curve",
    error=CurveError,
    suffixes=(".py",),
    group="epuck_sim.curves",
    shipped=lambda: dict.fromkeys(SHIPPED),
)
"""How response curves are found."""


def find_curve(name: str, folder: Path | None = None) -> Curve:
    """Return a response curve."""
    place = CURVE.locate(name, folder)
    return Curve(name, name, Path(), SHIPPED[name], None, {}, {}) if place.path is None else _load(place)


@kept
def _load(place: Place) -> Curve:
    file = load_python_file(place, CurveError)
    function = file.parts.get("phase_shift")
    if not callable(function):
        raise file.refusal("phase_shift", "a response curve needs a function phase_shift(phase, coupling, parameters)")
    check_draws(file, "a curve is a function of the phase")
    return Curve(**vars(describe_code(place, file)), phase_shift=function)


class ResponseSection(ConfigModel):
    """How a pulse shifts the phase of an agent that receives it (2.4, 5.1.1)."""

    later_keys: ClassVar[tuple[str, ...]] = ("parameters",)

    curve: str = "multiplicative"
    """Phase response curve, shift of the phase against the phase (5.1.1): the name of a shipped or installed one, or a
    file that ends in .py, relative to the scenario's file."""
    coupling: Annotated[Number, Field(ge=0, le=LARGEST)] = 0.1
    """Strength of the response: epsilon, or kappa of the sawtooth and sine curves."""
    refractory: Annotated[Number, Field(ge=0, lt=0.5)] = 0.0
    """Phase D, up to which pulses have no effect."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """The curve's further parameters by name; those that are left out have the curve's defaults."""

    @classmethod
    def keys_in_files(cls, values: Mapping[str, Any], folder: Path | None) -> dict[str, Sequence[str]]:
        """Return the names of the curve's parameters."""
        with suppress(EpuckSimError):
            return {"parameters": list(find_curve(str(values["curve"]), folder).parameters)}
        return {}

    def _check_together(self) -> None:
        if self.curve in UP_TO_1:
            check_range("coupling", self.coupling, 0, 1, f" for the {self.curve} curve")


def resolve_response(response: ResponseSection, origin: str, folder: Path | None = None) -> ResponseSection:
    """Return a response with the path of its curve, if that is a user's, and with all parameters."""
    with refused_at(f"{origin}.curve"):
        curve = find_curve(response.curve, folder)
    with refused_at(origin):
        parameters = curve.resolve(response.parameters)
        for step in range(TRIED_PHASES + 1) if curve.phase_shift else ():
            curve.check_shift(step / TRIED_PHASES, response.coupling, parameters)
    if (curve.stored_name, parameters) == (response.curve, response.parameters):
        return response
    return response.model_copy(update={"curve": curve.stored_name, "parameters": parameters})


_NEEDS = {
    "brownian": {"run_s": "above 0"},
    "correlated": {"run_s": "above 0", "persistence": "from 0 to 1"},
    "levy": {"run_s": "above 0", "exponent": "above 1 and up to 3"},
    "uniform": {"speed_spread": "above 0 and up to 1"},
    "normal": {"speed_spread": "above 0 and up to 1"},
    "lognormal": {"speed_spread": "above 0 and up to 2"},
    "two_speeds": {"fast_share": "above 0 and below 1", "fast_ratio": "above 1 and up to 1000"},
}
"""Keys that kinds of walks and distributions of speeds need, and their allowed values; other keys here are refused."""


def _check_needs(section: ConfigModel, tag: str, *keys: str) -> None:
    kind = getattr(section, tag)
    needed = _NEEDS.get(kind, {})
    for key in keys:
        is_given = getattr(section, key) is not None
        if is_given != (key in needed):
            what = f"takes no {key}; leave it out" if is_given else f"needs {key}, {needed[key]}"
            raise ValueError(f"{tag} {kind!r} {what}")


class WalkSection(ConfigModel):
    """How agents move between walls: straight ahead, or in straight runs with a turn at the end of each.

    A wall does not end a run: the rest of it continues after the wall.
    """

    kind: Literal["straight", "brownian", "correlated", "levy"] = "straight"
    """`straight`: no turns; `brownian`: runs of exponential duration, any new direction; `correlated`: the same, but
    the new direction is drawn around the old one; `levy`: durations with a power law, any new direction."""
    run_s: Positive | None = None
    """Mean duration of a run; of a `levy` walk the shortest, as the mean is infinite up to an exponent of 2."""
    persistence: Annotated[Number, Field(ge=0, le=1)] | None = None
    """Mean cosine g of the turns of a `correlated` walk; 0 makes it `brownian`, 1 never turns."""
    exponent: Annotated[Number, Field(gt=1, le=3)] | None = None
    """Exponent mu of a `levy` walk: the density of durations t falls as t^-mu, and the share of longer ones as
    t^(1 - mu)."""

    def _check_together(self) -> None:
        _check_needs(self, "kind", "run_s", "persistence", "exponent")


class AgentsSection(ConfigModel):
    """Number of agents, and how they move."""

    later_keys: ClassVar[tuple[str, ...]] = ("walk", "speed_per_run", "fast_share", "fast_ratio")

    count: Annotated[WholeNumber, Field(ge=1, le=1_000_000)] = 20
    """Number N of agents."""
    speed_cm_s: Annotated[Number, Field(ge=0, le=LARGEST)] = 1.0
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
    walk: WalkSection = WalkSection.model_construct()
    reorient_on: tuple[Literal["emitting", "receiving", "arriving"], ...] = ()
    """Pulses at which an agent turns to a random direction (D.1): those that it emits, those that shift its phase, or
    all that arrive. None turns twice at one instant."""

    def _check_together(self) -> None:
        _check_needs(self, "speed_distribution", "speed_spread", "fast_share", "fast_ratio")
        check_range("speed_spread", self.speed_spread, 0, 2 if self.speed_distribution == "lognormal" else 1)
        if self.speed_per_run:  # from a table of a thousand speeds
            check_range("fast_share", self.fast_share, 0.001, 0.999, ", where speed_per_run is true")
        if self.speed_per_run and (self.walk.kind == "straight" or self.speed_distribution == "fixed"):
            walk, speeds = self.walk.kind, self.speed_distribution
            said = f"speed_per_run is true, walk.kind is {walk!r} and speed_distribution is {speeds!r}"
            raise ValueError(f"{said}; speed_per_run needs runs that end, and speeds that differ")


class Nearest(ConfigModel):
    """The k agents nearest to the one that fires."""

    kind: Literal["nearest"]
    k: Annotated[WholeNumber, Field(ge=1)] = 1
    """Number K of agents that receive a pulse."""


class Range(ConfigModel):
    """All agents within a radius around the one that fires."""

    kind: Literal["range"]
    radius_cm: Length
    """Radius R."""


class Cone(ConfigModel):
    """A cone in the direction of motion: of vision, around the agent that receives, or of emission."""

    kind: Literal["cone_of_vision", "cone_of_emission"]
    """`cone_of_vision`: around the agent that receives; `cone_of_emission`: around the one that fires."""
    radius_cm: Length | None = None
    """Reach of the cone; unlimited by default."""
    angle_deg: Annotated[Number, Field(gt=0, le=360)]
    """Full opening angle."""


class Everybody(ConfigModel):
    """All agents."""

    kind: Literal["all"]


class RandomAgents(ConfigModel):
    """Agents drawn anew for each pulse, wherever they are: the mean field of fast agents (2.4)."""

    kind: Literal["random"]
    k: Annotated[WholeNumber, Field(ge=1)] = 1
    """Number K of agents that receive a pulse."""


Neighbourhood = Nearest | Range | Cone | Everybody | RandomAgents
"""The agents that receive the pulse of one that fires (2.4, 3.1.2, 5.1.3)."""


def _check_phases(given: Any) -> Any:
    if given in ("random", "synchronised"):
        return given
    is_list = isinstance(given, list | tuple) and not any(isinstance(phase, bool) for phase in given)
    if is_list and all(isinstance(phase, int | float) and 0 <= phase <= 1 for phase in given):
        return tuple(float(phase) for phase in given)
    raise ValueError("random, synchronised, or a list of numbers from 0 to 1, one for each agent")


Vectors = tuple[tuple[Number, ...], ...]


class StartSection(ConfigModel):
    """Phases, positions and headings at the start of a trial; positions and headings are random unless given."""

    later_keys: ClassVar[tuple[str, ...]] = ("positions_cm", "headings", "like")

    phases: Annotated[Literal["random", "synchronised"] | tuple[float, ...], BeforeValidator(_check_phases)] = "random"
    """`random`: uniform over the period; `synchronised`: all 0; or a list with a phase, 0 to 1, for each agent."""
    displacement: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Phase of agent 0, where all others start at 0 (5.4.1)."""
    positions_cm: Vectors | None = None
    """One row for each agent, with a coordinate for each dimension."""
    headings: Vectors | None = None
    """One row for each agent: a vector in the direction of its motion, of any length above 0."""
    like: str | None = None
    """Instead of the others, a scenario of robots, by its name or file: each trial starts with the phases, positions
    and headings of that scenario's trial with the same seed."""

    def check_fits(self, agents: int, dimensions: int, side_cm: float) -> None:
        """Raise ValueError if given values do not fit the agents and their space."""
        for name in ("phases", "positions_cm", "headings"):
            rows = getattr(self, name)
            if isinstance(rows, tuple) and len(rows) != agents:
                raise ValueError(f"start.{name} has {len(rows)} rows; allowed: {agents}, because that is agents.count")
        for key in ("positions_cm", "headings"):
            for number, row in enumerate(getattr(self, key) or ()):
                where = f"start.{key}.{number}"
                if len(row) != dimensions:
                    raise ValueError(f"{where} has {len(row)} numbers; allowed: {dimensions} (space.dimensions)")
                if key == "headings" and not any(row):
                    raise ValueError(f"{where} is {list(row)}; allowed: a vector that is not 0")
                for place in row if key == "positions_cm" else ():
                    check_range(where, place, 0, side_cm, " (space.side_cm)")

    def _check_together(self) -> None:
        if self.like is not None and self != StartSection.model_construct(like=self.like):
            raise ValueError(f"like is {self.like!r}; leave out all other keys of start, which it decides")
        if self.displacement and self.phases != "synchronised":
            raise ValueError(f"displacement is {self.displacement:g}; allowed: 0, or phases: synchronised")


MOST_SIDES = 1000
"""Largest mean distance, in sides of the space, that agents may move in a cycle; the thesis's fastest move one."""

MOST_RUNS = 1000  # largest number of runs of a random walk that agents may begin in a cycle, on average


class SpaceSection(ConfigModel):
    """The space in which agents move: a segment, a square or a cube (5.1.2, D.2, D.3)."""

    dimensions: Annotated[WholeNumber, Field(ge=1, le=3)] = 2
    """1: a segment; 2: a square; 3: a cube."""
    side_cm: Length = 100.0
    """Side L of the space."""
    boundary: Literal["bounded", "cyclic", "mirrored"] = "bounded"
    """`bounded`: agents leave a wall in a random direction; `mirrored`: as light leaves a mirror; `cyclic`: agents
    leave on one side and enter opposite."""


class ClocksSection(ConfigModel):
    """The oscillators' periods."""

    period_s: Positive = 1.0
    """Period tau."""
    jitter: Annotated[Number, Field(ge=0, le=0.2)] = 0.0
    """Standard deviation of the periods relative to `period_s` (5.4.2); no period is below a tenth of it."""


class ParticleStop(StopSection):
    """When a trial ends (3.1.5, 5.1.4)."""

    later_keys: ClassVar[tuple[str, ...]] = (*StopSection.later_keys, "max_time_s")

    order_parameter: Annotated[Number, Field(gt=0, le=1)] | None = 1 - 1e-9
    """Threshold of the order parameter; null: trials do not end with synchrony."""
    metric: Literal["complex", "reference"] = "complex"  # robots may have others: these are all that kernels know
    max_cycles: Annotated[WholeNumber, Field(ge=1, le=10**9)] = 10**7
    reference: Annotated[WholeNumber, Field(ge=0)] = 0
    """Number of the agent whose firings are counted, from 0."""


class ParticleScenario(Scenario):
    """A swarm of point-like agents (chapters 3 and 5)."""

    later_keys: ClassVar[tuple[str, ...]] = ("faults", "schedule")
    refused: ClassVar[tuple[str, ...]] = ("faults.N.robots", *NOT_OF_AGENTS)

    name: Annotated[str, Field(min_length=1, max_length=100)] = "particles"
    model: Literal["particles"]
    space: SpaceSection = SpaceSection.model_construct()
    agents: AgentsSection = AgentsSection.model_construct()
    neighbourhood: Annotated[Neighbourhood, Field(discriminator="kind")] = Nearest.model_construct(kind="nearest")
    response: ResponseSection = ResponseSection.model_construct()
    clocks: ClocksSection = ClocksSection.model_construct()
    start: StartSection = StartSection.model_construct()
    faults: tuple[AnyFault, ...] = ()
    schedule: tuple[AgentScheduleEntry, ...] = ()
    stop: ParticleStop = ParticleStop.model_construct()

    def _check_together(self) -> None:
        agents, others, period_s = self.agents, self.agents.count - 1, self.clocks.period_s
        fastest_cm_s = MOST_SIDES * self.space.side_cm / period_s
        check_range("agents.speed_cm_s", agents.speed_cm_s, 0, fastest_cm_s, f", {MOST_SIDES} sides a period")
        why = f", up to {MOST_RUNS} runs a period"
        check_range("agents.walk.run_s", agents.walk.run_s, period_s / MOST_RUNS, LARGEST, why)
        if isinstance(self.neighbourhood, Nearest | RandomAgents):
            why = f", because agents.count is {agents.count}"
            check_range("neighbourhood.k", self.neighbourhood.k, 1, max(others, 1), why)
        self.start.check_fits(others + 1, self.space.dimensions, self.space.side_cm)
        check_range("stop.reference", self.stop.reference, 0, others)
        for number, entry in enumerate(self.schedule):
            if self.agents.speed_per_run and "agents.speed_cm_s" in entry.set:
                said = "agents.speed_cm_s cannot change where agents.speed_per_run is true"
                raise ValueError(f"schedule.{number}.set: {said}; leave one of them out")
        if {"agents", "agents.count"}.isdisjoint(self.swept):  # else each point is checked
            check_changes(self.faults, self.schedule, "agent", self.agents.count)
        for number, fault in enumerate(self.faults):
            if fault.kind in NOT_OF_AGENTS:
                why = NOT_OF_AGENTS[fault.kind]
                raise ValueError(f"faults.{number}: kind {fault.kind!r} has no meaning for agents: {why}")
            if fault.kind == "wheels_dead" and self.agents.speed_per_run:
                said = "agents whose wheels are dead draw no speeds, but agents.speed_per_run is true"
                raise ValueError(f"faults.{number}: {said}; leave one of them out")

    @property
    def notes(self) -> list[str]:
        """Notes of `Scenario.notes`, and one on periods that differ too much for the threshold."""
        found = [*super().notes, *notes_on_faults(self.faults, self.schedule, "agent", self.stop.reference)]
        jitter, threshold = self.clocks.jitter, self.stop.order_parameter
        if threshold is not None and jitter and threshold > 1 - jitter**2:
            said = f"agents whose periods differ may never reach an order parameter of {threshold:.12g}"
            found.append(f"clocks.jitter is {jitter:g}: {said}; for a lower one: --set stop.order_parameter=0.95")
        return found

    def check_twin(self) -> None:
        """Raise ScenarioError for a schedule whose entries may act at other moments in a twin of a trial."""
        if any(entry.at_s is None for entry in self.schedule):
            raise ScenarioError("a trial and its twin change alike only at given times; give at_s in the schedule")

    @property
    def scales(self) -> dict[str, float]:
        """The coupling epsilon, the side L in cm, the number N of agents and the period tau in s."""
        return {
            "epsilon": self.response.coupling,
            "L": self.space.side_cm,
            "N": float(self.agents.count),
            "tau": self.clocks.period_s,
        }

    @property
    def scale_keys(self) -> tuple[str, ...]:
        """Dotted keys of the values on which `scales`, and the speed, depend."""
        return ("agents.speed_cm_s", "response.coupling", "space.side_cm", "agents.count", "clocks.period_s")

    @property
    def population(self) -> int:
        """Number of agents."""
        return self.agents.count

    @property
    def compiled(self) -> tuple[str, ...]:
        """Names of what is compiled for its trials: the model, and a user's response curve."""
        curve = self.response.curve
        return (self.model,) if curve in SHIPPED else (self.model, curve)

    def resolved(self, origin: str, folder: Path | None = None) -> Self:
        """Return the scenario with the response curve, measures and their parameters; see `Scenario.resolved`."""
        swept = set(self.swept)
        response = self.response  # its curve, hence its parameters, may be known at each point only
        if not {"response", "response.curve"} & swept:
            response = resolve_response(response, f"{origin}: response", folder)
        found = super().resolved(origin, folder)
        if response is not self.response:  # a copy takes a tenth of the time of a short trial
            found = found.model_copy(update={"response": response})
        if not {"response", "response.curve", "neighbourhood", "neighbourhood.kind"} & swept:
            # entries are checked one by one: whether a key's value is allowed depends only on keys that never change
            for number, entry in enumerate(found.schedule):
                if entry.set:
                    found.with_set(entry.set, f"{origin}: schedule.{number}.set")
        return found

    def with_set(self, values: Mapping[str, Any], origin: str) -> Self:
        """Return the scenario, resolved, with new values of dotted keys that a schedule may set."""
        changing = ("agents", "neighbourhood", "response")
        given = self.model_dump(include={"model", "space", "clocks", *changing})
        checked = self.validated(set_values(given, values, origin), origin)
        changed = {section: getattr(checked, section) for section in changing}
        changed["response"] = resolve_response(checked.response, f"{origin}: response")
        return self.model_copy(update=changed)
