"""What the sections of a scenario have in common: no unknown keys, plain numbers, no change after they were made."""

from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field


def _no_truth_value(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("a number, not true or false")  # noqa: TRY004 pydantic gathers ValueErrors
    return value


Number = Annotated[float, BeforeValidator(_no_truth_value)]
WholeNumber = Annotated[int, BeforeValidator(_no_truth_value)]
Positive = Annotated[Number, Field(gt=0, le=1e6)]


class ConfigModel(BaseModel):
    """Part of a scenario: no unknown keys, no NaN, no change after it was made."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
