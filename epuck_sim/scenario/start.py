"""The start of a trial of point-like agents: their phases, places and headings."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PlainValidator, model_validator

from epuck_sim.scenario.base import ConfigModel, Number


def _check_phases(given: Any) -> Any:
    """Return a name, or one phase for each agent as a tuple."""
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

    phases: Annotated[Literal["random", "synchronised"] | tuple[float, ...], PlainValidator(_check_phases)] = "random"
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
        """Raise ValueError if what is given does not fit the agents and their space."""
        given = {"phases": self.phases, "positions_cm": self.positions_cm, "headings": self.headings}
        for name, rows in given.items():
            if isinstance(rows, tuple) and len(rows) != agents:
                raise ValueError(f"start.{name} has {len(rows)} rows; allowed: {agents}, because that is agents.count")
        for name in ("positions_cm", "headings"):
            for number, row in enumerate(given[name] or ()):
                assert isinstance(row, tuple)
                if len(row) != dimensions:
                    raise ValueError(f"start.{name}.{number} has {len(row)} numbers; allowed: {dimensions}, dimensions")
                if name == "positions_cm" and not all(0 <= place <= side_cm for place in row):
                    raise ValueError(f"start.{name}.{number} is {list(row)}; allowed: 0 to {side_cm:g}, space.side_cm")
                if name == "headings" and not any(row):
                    raise ValueError(f"start.{name}.{number} is {list(row)}; allowed: a vector that is not 0")

    @model_validator(mode="after")
    def _check_like(self) -> "StartSection":
        if self.like is not None and self != StartSection.model_construct(like=self.like):
            raise ValueError(f"like is {self.like!r}; leave out all other keys of start, which it decides")
        return self

    @model_validator(mode="after")
    def _check_displacement(self) -> "StartSection":
        if self.displacement and self.phases != "synchronised":
            raise ValueError(
                f"displacement is {self.displacement:g} and phases is {self.phases!r}; allowed: 0, or phases: "
                "synchronised"
            )
        return self
