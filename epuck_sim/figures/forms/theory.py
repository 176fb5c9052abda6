"""Curves of T_sync against speed, with the predictions of theory dashed below them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes

from epuck_sim.arrays import FloatArray
from epuck_sim.display.table import Row
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import Estimate
from epuck_sim.figures.forms.curves import Curves
from epuck_sim.figures.forms.form import Choices
from epuck_sim.figures.saving import tabulate_rows
from epuck_sim.figures.style import GREY, typeset
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.curves import Curve, check_speed_alone
from epuck_sim.theory.predict import Prediction, predictor

AXES = ("agents.speed_cm_s", "robots.0.parameters.speed_cm_s")  # axes over which there are predictions
MOST_CURVES = 12  # largest number of curves that are predicted: each takes about a second
SPEEDS = 60  # number of speeds at which a curve is predicted

DASHES: dict[str, Any] = {"linestyle": (0, (5, 2)), "linewidth": 0.7, "zorder": 1.5}
"""Looks of predictions, which lie under the results of trials."""

PLACE: dict[str, Any] = {"markerfacecolor": "white", "markersize": 5, "linewidth": 0.7}  # looks of V_m and V_p
EDGE = 0.04  # length of the marks of the limits at the edges of a panel, as a share of its width

CELLS = ("regime", "probability", "v_m", "v_p", "t_frozen", "frozen_share", "t_fast")  # cells of the table

CAPTION = (
    "dashed is T_sync as predict computes it from who hears whom, without a trial: curves, at the left edge for "
    "standing swarms, at the right for the fastest"
)
HOLLOW = "; hollow triangles are the predicted V_m (down) and V_p (up), with a standard deviation either way"


class Predicted(NamedTuple):
    """Prediction of a curve."""

    speeds: FloatArray  # (S,) cm/s, ascending
    times: FloatArray  # (S,) T_sync, cycles
    at_any: Prediction  # what holds at all of these speeds

    @property
    def places(self) -> list[tuple[Estimate, str]]:
        """V_m and V_p where they are within the speeds, and their markers."""
        places = ((self.at_any.v_m_cm_s, "v"), (self.at_any.v_p_cm_s, "^"))
        return [each for each in places if self.speeds[0] <= each[0].value <= self.speeds[-1]]


def predict_curves(axis: str, curves: Sequence[Curve]) -> list[Predicted]:
    """Return predictions of curves of T_sync; raise EpuckSimError if the axis or a swarm cannot be predicted."""
    if curves[0].of is not None or axis not in AXES:
        this = f"{curves[0].of or 'this'} is against {axis}"
        raise EpuckSimError(f"predictions are of T_sync in cycles against {' or '.join(AXES)}, but {this}")
    if len(curves) > MOST_CURVES:
        raise EpuckSimError(f"predictions are of up to {MOST_CURVES} curves, but these are {len(curves)}")
    check_speed_alone(curves)
    found = []
    for curve in curves:
        moving = curve.x[curve.x > 0]
        speeds = np.geomspace(moving.min(), moving.max(), SPEEDS) if len(moving) else np.zeros(1)
        at = [*map(predictor(curve.scenario), speeds.tolist())]
        found.append(Predicted(speeds, np.array([each.t_sync.value for each in at]), at[0]))
    return found


@dataclass(kw_only=True)
class PredictedCurves(Curves):
    """Curves with their predictions."""

    predicted: Sequence[Predicted] = ()  # prediction of each curve; empty if there can be none
    reason: str = ""  # why there are none, though the scenario asks for them

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        """Estimate and predict curves; raise EpuckSimError if an option asks for predictions that cannot be made."""
        form = super().read(points, choices)
        try:
            form.predicted = predict_curves(form.axis, form.curves)
        except EpuckSimError as error:
            if "theory" in choices.given:
                raise EpuckSimError(f"{choices.prefix}theory: {error}") from error
            form.reason = str(error)
        form.others = [each.times for each in form.predicted]
        return form

    @property
    def tables(self) -> Mapping[str, str]:
        """The tables of the curves, and one with the verdict, V_m, V_p, and T_sync in both limits for each curve."""
        each = zip(self.curves, self.predicted, strict=False)
        rows = [Row(curve.axes, {name: predicted.at_any.cells[name] for name in CELLS}) for curve, predicted in each]
        return {**super().tables, **({"-theory.csv": tabulate_rows(rows)} if rows else {})}

    @property
    def notes(self) -> Sequence[str]:
        """Sentences on parts that curves do not show, and that predictions leave out."""
        if not self.predicted:
            return [*super().notes, f"no prediction: {self.reason}"]
        left_out = dict.fromkeys(note.removesuffix(".") for each in self.predicted for note in each.at_any.notes)
        return [*super().notes, f"{CAPTION}{HOLLOW * any(each.places for each in self.predicted)}", *left_out]

    def draw(self, panels: Sequence[Axes]) -> None:
        for panel, each, (*_, look) in zip(self.panels_of(panels), self.predicted, self.placed, strict=False):
            speeds, times, at_any = each
            looks: Any = {"color": look.colour, **DASHES}
            panel.plot(speeds, times, **looks)
            for limit, edge in ((at_any.t_sync_frozen, (0, EDGE)), (at_any.t_sync_fast, (1 - EDGE, 1))):
                panel.plot(edge, (limit.value,) * 2, transform=panel.get_yaxis_transform(), **looks)
            for place, marker in each.places:
                ends = np.clip((place.low, place.value, place.high), speeds[0], speeds[-1])
                time = np.interp(np.log(place.value), np.log(speeds), times)
                panel.plot(ends, (time,) * 3, marker=marker, markevery=[1], color=look.colour, **PLACE)
        super().draw(panels)
        if self.predicted:
            panels[0].plot([], [], color=GREY, label="predicted", **DASHES)
        if any(each.places for each in self.predicted):
            panels[0].plot([], [], "^", color=GREY, label=typeset("predicted V_m and V_p"), **PLACE)
