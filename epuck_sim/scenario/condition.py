"""Conditions on measures: a trial ends, or something changes, when one of them holds."""

import re
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number

CONDITION = re.compile(r"\s*(\w+)\s*(>=|<=|>|<)\s*([-+.\w]+)\s*")
"""A condition as text: a measure, a relation and a number."""


class Condition(ConfigModel):
    """A condition on a measure; also read from text, such as `near_walls < 0.2`."""

    measure: Annotated[str, Field(min_length=1)]
    """One of the scenario's measures, or `order_parameter`; of a series the last value counts, true counts as 1."""
    relation: Literal[">", ">=", "<", "<="]
    """How the measure is compared with the value."""
    value: Number
    """Number with which the measure is compared."""

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, given: Any) -> Any:
        if not isinstance(given, str):
            return given
        found = CONDITION.fullmatch(given)
        if found is None:
            raise ValueError("MEASURE >= NUMBER, with >=, >, <= or <")
        return dict(zip(("measure", "relation", "value"), found.groups(), strict=True))

    def holds(self, value: float) -> bool:
        """Return whether a value of the measure satisfies the condition."""
        if self.relation in (">", ">="):
            return value > self.value or (value == self.value and self.relation == ">=")
        return value < self.value or (value == self.value and self.relation == "<=")

    def __str__(self) -> str:
        """Return the condition as text."""
        return f"{self.measure} {self.relation} {self.value:.12g}"


class Awaited(NamedTuple):
    """A condition that a trial waits for."""

    condition: Condition
    for_cycles: int | None = None
    """Firings of the reference in a row at which it must hold; None: it is awaited wherever the measure is told."""
