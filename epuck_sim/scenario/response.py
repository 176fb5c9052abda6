"""The response of an oscillator to a pulse: its curve, and the curve's parameters (thesis 2.4, 5.1.1)."""

from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field, model_validator

from epuck_sim.errors import CurveError, ScenarioError
from epuck_sim.scenario.base import ConfigModel, Number
from epuck_sim.scenario.curves import UP_TO_1, find_curve


class ResponseSection(ConfigModel):
    """How a pulse shifts the phase of an agent that receives it (2.4, 5.1.1)."""

    later_keys: ClassVar[tuple[str, ...]] = ("parameters",)

    curve: str = "multiplicative"
    """Phase response curve, shift of the phase against the phase (5.1.1): the name of a shipped or installed one, or a
    file that ends in .py, relative to the scenario's file."""
    coupling: Annotated[Number, Field(ge=0, le=1e6)] = 0.1
    """Strength of the response: epsilon, or kappa of the sawtooth and sine curves."""
    refractory: Annotated[Number, Field(ge=0, lt=0.5)] = 0.0
    """Phase D, up to which pulses have no effect."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """The curve's further parameters by name; those that are left out have the curve's defaults."""

    @model_validator(mode="after")
    def _check_coupling(self) -> "ResponseSection":
        if self.curve in UP_TO_1 and self.coupling > 1:
            raise ValueError(f"coupling is {self.coupling:g}; allowed: 0 to 1 for the {self.curve} curve")
        return self


def resolve_response(response: ResponseSection, origin: str, folder: Path | None = None) -> ResponseSection:
    """Return a response with the path of its curve, if that is a user's, and with all parameters.

    Raises:
        ScenarioError: There is no such curve, or it does not take these parameters; the message begins with `origin`.
    """
    try:
        curve = find_curve(response.curve, folder)
    except CurveError as error:
        raise ScenarioError(f"{origin}.curve: {error}") from error
    try:
        parameters = curve.resolve(response.parameters)
        curve.check_shifts(response.coupling, parameters)
    except (CurveError, ValueError) as error:
        raise ScenarioError(f"{origin}: {error}") from error
    if (curve.name, parameters) == (response.curve, response.parameters):
        return response
    return response.model_copy(update={"curve": curve.name, "parameters": parameters})
