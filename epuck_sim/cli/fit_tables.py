"""Tables of `epuck-sim fit`: local minima and peaks, and scaling laws."""

import json
import math
import sys
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.cli.tables import WIDE
from epuck_sim.figures.labels import distinguishing_labels
from epuck_sim.statistics.estimate import Estimate
from epuck_sim.statistics.extrema import SpeedExtrema
from epuck_sim.statistics.fast_regime import FAST_FACTOR
from epuck_sim.statistics.scaling_fit import FittedCurve, Laws
from epuck_sim.statistics.scaling_laws import LAWS
from epuck_sim.statistics.summary import finite_or_none

EXTREMA_HEADINGS = ("V_m [cm/s]", "T_m [cycles]", "V_p [cm/s]", "T_p [cycles]")


NOUNS = {"embodied": "robots", "particles": "point agents"}
"""Names of the models."""

NOTES = {
    "embodied": "Thesis 4.2.2. The exponents of T_m and T_p ignore its offset K; the larger K, the closer to 0.",
    "particles": "The thesis's laws of T_m and T_p (4.2.2) are of robots. Agents are points: T_sync does not depend\n"
    "on L where V and R grow with it, and T_p grows exponentially with N (5.4.1). V_m and V_p: 4.2.2; V_f: 5.4.1.",
}
"""What the thesis claims, by model."""


def print_fit(curves: Sequence[FittedCurve], laws: Laws, as_json: bool) -> None:
    """Print the local minimum and the peak of each curve, and the laws, on stdout."""
    if as_json:
        print(json.dumps({"curves": [_curve_object(curve) for curve in curves], "laws": _laws_object(laws)}))
        return
    console = Console(width=None if sys.stdout.isatty() else WIDE)
    _print_extrema(console, curves)
    if laws.reason:
        print(f"No laws: {laws.reason}.")
    else:
        _print_laws(console, laws)


def _print_extrema(console: Console, curves: Sequence[FittedCurve]) -> None:
    has_v_f = any("V_f" in LAWS.get(curve.model, {}) for curve in curves)
    headings = ("run", "curve", *EXTREMA_HEADINGS, "p", *["V_f [cm/s]"] * has_v_f)
    table = _make_table("Local minimum and peak, with 95 % intervals", *headings)
    for run in dict.fromkeys(curve.run for curve in curves):
        group = [curve for curve in curves if curve.run == run]
        for curve, label in zip(group, distinguishing_labels([curve.axes for curve in group]), strict=True):
            table.add_row(Text(run), Text(label), *_extrema_cells(curve), *[_v_f_cell(curve)] * has_v_f)
    console.print(table)
    names = dict.fromkeys(name for curve in curves for name in curve.names)
    print(f"T_m and T_p: {' or '.join(names)}. -: no minimum and peak that noise could not explain.")
    for reason in dict.fromkeys(curve.reason for curve in curves if curve.reason):
        count = sum(curve.reason == reason for curve in curves)
        print(f"?: not looked for on {count} of {len(curves)} curves: {reason}.")
    if has_v_f:
        print(f"V_f: from there on T_sync is less than {FAST_FACTOR:g} times that at the largest speed.")


def _print_laws(console: Console, laws: Laws) -> None:
    title = f"Scaling laws of {laws.curves} curves of {NOUNS.get(laws.model, laws.model)}"
    table = _make_table(title, "quantity", "parameter", "form", "exponent", "thesis", "misfit")
    for row in laws.exponents:
        thesis = "" if row.thesis is None else f"{row.thesis:g}" if row.thesis else "none"
        misfit = f"{row.misfit:.1f}" if math.isfinite(row.misfit) else "-"
        table.add_row(row.quantity, row.parameter, row.form, _format_estimate(row.exponent), thesis, misfit)
    console.print(table)
    for quantity, law in laws.offset_laws.items():
        factor, offset = _format_estimate(law.factor), _format_estimate(law.offset)
        fitted = f"A = {factor} cycles s^2/cm, K = {offset} cycles, R^2 = {law.r_squared:.2f}".replace("nan", "-")
        print(f"{quantity} = A L e^N / tau^2 + K: {fitted}")
    print("Intervals account for the noise of the trials alone; where a misfit is far above 1, the law does not hold.")
    print(NOTES.get(laws.model, NOTES["embodied"]))
    if laws.left_out:
        several = f"{laws.left_out} curves with a minimum and a peak"
        print(f"{several} are left out: they differ in more than V, epsilon, L, N and tau.")


def _make_table(title: str, *headings: str) -> Table:
    """Return a table whose cells are folded, never cut, where the terminal is narrow."""
    table = Table(title=title, title_justify="left")
    for heading in headings:
        table.add_column(Text(heading), overflow="fold")
    return table


def _extrema_cells(curve: FittedCurve) -> list[str]:
    extrema = curve.extrema
    if extrema is None:
        return ["?"] * (len(EXTREMA_HEADINGS) + 1)
    if not extrema.is_found:
        return ["-"] * len(EXTREMA_HEADINGS) + [f"{extrema.p_value:.3f}"]
    return [*map(_format_estimate, _estimates(extrema).values()), f"{extrema.p_value:.3f}"]


def _v_f_cell(curve: FittedCurve) -> str:
    return _format_estimate(curve.v_f[0]) if curve.v_f else "-"


def _estimates(extrema: SpeedExtrema) -> dict[str, Estimate]:
    values = {"v_m": extrema.v_m, "t_m": extrema.t_m, "v_p": extrema.v_p, "t_p": extrema.t_p}
    return {name: Estimate(values[name], *ends) for name, ends in zip(values, extrema.intervals.tolist(), strict=True)}


def _format_estimate(estimate: Estimate) -> str:
    return f"{estimate.value:.3g} ({estimate.low:.3g} to {estimate.high:.3g})"


def _curve_object(curve: FittedCurve) -> dict[str, Any]:
    extrema = curve.extrema
    estimates: dict[str, Any] = dict.fromkeys(("v_m", "t_m", "v_p", "t_p"))
    if extrema is not None and extrema.is_found:
        estimates = {name: estimate._asdict() for name, estimate in _estimates(extrema).items()}
    return {
        "run": curve.run,
        "axes": curve.axes,
        "statistic": curve.names,
        "p_value": extrema and extrema.p_value,
        "reason": curve.reason,
        **estimates,
        "v_f": curve.v_f and curve.v_f[0]._asdict(),
    }


def _laws_object(laws: Laws) -> dict[str, Any]:
    exponents = [
        {**row._asdict(), "exponent": row.exponent._asdict(), "misfit": finite_or_none(row.misfit)}
        for row in laws.exponents
    ]
    offset_laws = {
        name: {
            "factor": law.factor._asdict(),
            "offset": law.offset._asdict(),
            "r_squared": finite_or_none(law.r_squared),
        }
        for name, law in laws.offset_laws.items()
    }
    return {**laws._asdict(), "exponents": exponents, "offset_laws": offset_laws}
