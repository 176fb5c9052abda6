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
from epuck_sim.statistics.extrema import SpeedExtrema
from epuck_sim.statistics.scaling_fit import FittedCurve, Laws
from epuck_sim.statistics.scaling_laws import Estimate
from epuck_sim.statistics.summary import finite_or_none

EXTREMA_HEADINGS = ("V_m [cm/s]", "T_m [cycles]", "V_p [cm/s]", "T_p [cycles]")


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
    table = _make_table("Local minimum and peak, with 95 % intervals", "run", "curve", *EXTREMA_HEADINGS, "p")
    for run in dict.fromkeys(curve.run for curve in curves):
        group = [curve for curve in curves if curve.run == run]
        for curve, label in zip(group, distinguishing_labels([curve.axes for curve in group]), strict=True):
            table.add_row(Text(run), Text(label), *_extrema_cells(curve.extrema))
    console.print(table)
    print("-: no minimum and peak that noise could not explain.")


def _print_laws(console: Console, laws: Laws) -> None:
    title = f"Scaling laws of {laws.curves} curves, thesis 4.2.2"
    table = _make_table(title, "quantity", "parameter", "form", "exponent", "thesis", "misfit")
    for row in laws.exponents:
        thesis = f"{row.thesis:g}" if row.thesis else "none"
        misfit = f"{row.misfit:.1f}" if math.isfinite(row.misfit) else "-"
        table.add_row(row.quantity, row.parameter, row.form, _format_estimate(row.exponent), thesis, misfit)
    console.print(table)
    for quantity, law in laws.offset_laws.items():
        factor, offset = _format_estimate(law.factor), _format_estimate(law.offset)
        fitted = f"A = {factor} cycles s^2/cm, K = {offset} cycles, R^2 = {law.r_squared:.2f}".replace("nan", "-")
        print(f"{quantity} = A L e^N / tau^2 + K: {fitted}")
    print("Intervals account for the noise of the trials alone; where a misfit is far above 1, the law does not hold.")
    print("T_m and T_p: the exponents ignore the offset K of the thesis; the larger it is, the closer they are to 0.")
    if laws.left_out:
        several = f"{laws.left_out} curves with a minimum and a peak"
        print(f"{several} are left out: they differ in more than V, epsilon, L, N and tau.")


def _make_table(title: str, *headings: str) -> Table:
    """Return a table whose cells are folded, never cut, where the terminal is narrow."""
    table = Table(title=title, title_justify="left")
    for heading in headings:
        table.add_column(Text(heading), overflow="fold")
    return table


def _extrema_cells(extrema: SpeedExtrema | None) -> list[str]:
    if extrema is None:
        return ["too few speeds"]
    if not extrema.is_found:
        return ["-"] * len(EXTREMA_HEADINGS) + [f"{extrema.p_value:.3f}"]
    return [*map(_format_estimate, _estimates(extrema).values()), f"{extrema.p_value:.3f}"]


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
    return {"run": curve.run, "axes": curve.axes, "p_value": extrema and extrema.p_value, **estimates}


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
