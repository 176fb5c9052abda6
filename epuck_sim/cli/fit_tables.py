"""What `epuck-sim fit` prints: regimes and scaling laws."""

import json
import math
import sys
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.cli.tables import WIDE
from epuck_sim.figures.labels import format_axis_values
from epuck_sim.statistics.curves import distinguishing_axes
from epuck_sim.statistics.extrema import SpeedExtrema
from epuck_sim.statistics.scaling_fit import FittedCurve, Laws
from epuck_sim.statistics.scaling_laws import Estimate

QUANTITIES = ("V_m [cm/s]", "T_m [cycles]", "V_p [cm/s]", "T_p [cycles]")


def print_fit(curves: Sequence[FittedCurve], laws: Laws, as_json: bool) -> None:
    """Print the regimes of each curve, and the laws, on stdout."""
    if as_json:
        print(json.dumps({"curves": [_curve_object(curve) for curve in curves], "laws": _laws_object(laws)}))
        return
    console = Console(width=None if sys.stdout.isatty() else WIDE)
    table = Table(title="Local minimum and peak, with 95 % intervals", title_justify="left")
    for heading in ("run", "curve", *QUANTITIES, "p"):
        table.add_column(Text(heading))
    for run in dict.fromkeys(curve.run for curve in curves):
        group = [curve for curve in curves if curve.run == run]
        for curve, axes in zip(group, distinguishing_axes([curve.axes for curve in group]), strict=True):
            table.add_row(Text(run), Text(format_axis_values(axes)), *_bump_cells(curve.bump))
    console.print(table)
    print("-: no rise that noise would not make, or undo.")
    if laws.reason:
        print(f"No laws: {laws.reason}.")
        return
    table = Table(title=f"Scaling laws of {laws.curves} curves, thesis 4.2.2", title_justify="left")
    for heading in ("quantity", "parameter", "form", "exponent", "thesis", "misfit"):
        table.add_column(heading)
    for row in laws.exponents:
        thesis = f"{row.thesis:g}" if row.thesis else "none"
        misfit = f"{row.misfit:.1f}" if math.isfinite(row.misfit) else "-"
        table.add_row(row.quantity, row.parameter, row.form, _told(row.exponent), thesis, misfit)
    console.print(table)
    for quantity, law in laws.offset_laws.items():
        print(
            f"{quantity} = A L e^N / tau^2 + K: A = {_told(law.factor)}, K = {_told(law.offset)}, "
            f"R^2 = {law.r_squared:.2f}".replace("nan", "-")
        )
    print("Intervals hold the noise of the trials alone; a misfit far above 1 says that the law does not hold.")
    print("T_m and T_p: exponents leave the thesis's offset K out, and are the nearer to 0 the larger it is.")
    if laws.left_out:
        print(f"{laws.left_out} curves with both are left out: they differ in more than V, epsilon, L, N and tau.")


def _bump_cells(bump: SpeedExtrema | None) -> list[str]:
    if bump is None:
        return ["too few speeds"]
    if not bump.is_found:
        return ["-"] * len(QUANTITIES) + [f"{bump.p_value:.3f}"]
    return [*map(_told, _estimates(bump).values()), f"{bump.p_value:.3f}"]


def _estimates(bump: SpeedExtrema) -> dict[str, Estimate]:
    values = {"v_m": bump.v_m, "t_m": bump.t_m, "v_p": bump.v_p, "t_p": bump.t_p}
    return {name: Estimate(values[name], *ends) for name, ends in zip(values, bump.intervals.tolist(), strict=True)}


def _told(estimate: Estimate) -> str:
    return f"{estimate.value:.3g} ({estimate.low:.3g} to {estimate.high:.3g})"


def _curve_object(curve: FittedCurve) -> dict[str, Any]:
    bump = curve.bump
    estimates: dict[str, Any] = dict.fromkeys(("v_m", "t_m", "v_p", "t_p"))
    if bump is not None and bump.is_found:
        estimates = {name: estimate._asdict() for name, estimate in _estimates(bump).items()}
    return {"run": curve.run, "axes": curve.axes, "p_value": bump and bump.p_value, **estimates}


def _laws_object(laws: Laws) -> dict[str, Any]:
    exponents = [
        {**row._asdict(), "exponent": row.exponent._asdict(), "misfit": _finite(row.misfit)} for row in laws.exponents
    ]
    offset_laws = {
        name: {"factor": law.factor._asdict(), "offset": law.offset._asdict(), "r_squared": _finite(law.r_squared)}
        for name, law in laws.offset_laws.items()
    }
    return {**laws._asdict(), "exponents": exponents, "offset_laws": offset_laws}


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None
