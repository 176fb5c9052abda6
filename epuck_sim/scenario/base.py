"""The base of all sections of a scenario, and the kinds of numbers in them."""

from typing import Annotated, Any, ClassVar

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
    """Keys that came later; seeds of resamples leave out their defaults, so that earlier folders keep their numbers."""

    def later_defaults(self) -> dict[str, Any]:
        """Return the later keys that have their defaults, of all sections in this one, as pydantic's `exclude`."""
        found: dict[str, Any] = {}
        for key, field in type(self).model_fields.items():
            value = getattr(self, key)
            if key in self.later_keys and value == field.get_default(call_default_factory=True):
                found[key] = True
            elif inner := _later_defaults_in(value):
                found[key] = inner
        return found


def _later_defaults_in(value: object) -> dict[str, Any] | dict[int, Any]:
    if isinstance(value, ConfigModel):
        return value.later_defaults()
    if isinstance(value, tuple):
        return {place: inner for place, item in enumerate(value) if (inner := _later_defaults_in(item))}
    return {}
