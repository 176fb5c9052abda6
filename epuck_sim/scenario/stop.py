"""When a trial ends: with synchrony, when a measure has passed a value, or at its limits."""

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber
from epuck_sim.scenario.condition import Condition


class StopSection(ConfigModel):
    """When a trial ends."""

    later_keys: ClassVar[tuple[str, ...]] = ("when",)

    order_parameter: Annotated[Number, Field(gt=0, le=1)] | None
    """The swarm is synchronised once the order parameter reaches this value at a firing of the reference.

    If it is null, trials have no T_sync and end otherwise; it is null by default where there is a condition `when`.
    """
    metric: Literal["complex", "reference"] = "complex"
    """`complex`: eqs. 4.2 and 5.7; `reference`: eq. 3.4."""
    max_cycles: Annotated[WholeNumber, Field(ge=1, le=10**9)]
    """Firings of the reference after which the trial ends, and is censored if it was to be synchronised."""
    max_time_s: Annotated[Number, Field(gt=0, le=1e10)] | None = None
    """The trial also ends after this time."""
    when: Condition | None = None
    """The trial also ends when this holds."""

    @model_validator(mode="before")
    @classmethod
    def _end_by_condition_alone(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("when") is not None:
            return {"order_parameter": None, **given}
        return given

    @model_validator(mode="after")
    def _check_ends(self) -> Self:
        if self.when is not None and self.order_parameter is not None:
            raise ValueError(
                f"order_parameter is {self.order_parameter:g} and when is {str(self.when)!r}; give order_parameter: "
                "null, as trials cannot end with synchrony and by another condition"
            )
        return self
