"""The base of all sections of a scenario, and the kinds of numbers in them."""

from typing import Annotated, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field


def _reject_bool(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("a number, not true or false")  # noqa: TRY004 pydantic gathers ValueErrors
    return value


Number = Annotated[float, BeforeValidator(_reject_bool)]
WholeNumber = Annotated[int, BeforeValidator(_reject_bool)]
Positive = Annotated[Number, Field(gt=0, le=1e6)]


class ConfigModel(BaseModel):
    """A section of a scenario: it has no unknown keys and no NaN, and cannot be changed."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    later_keys: ClassVar[tuple[str, ...]] = ()
    """Keys that came later; seeds of resamples leave them out, so that earlier folders keep their numbers."""
