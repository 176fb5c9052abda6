"""What `epuck-sim compare-film` prints: a film compared with trials, and what the film determines."""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.cli.tables import WIDE
from epuck_sim.overhead.compare import QuantityComparison
from epuck_sim.overhead.film_fit import Fitted
from epuck_sim.util.provenance import versions

UNTOLD = (
    "A film does not tell coupling, refractory time, what robots see and how late, or gains of infrared sensors: those "
    "stay as the scenario has them, and trials may differ from the film by them."
)


def print_comparison_json(
    film: str, scenario: str, rows: Sequence[QuantityComparison], fitted: Mapping[str, Fitted]
) -> None:
    """Print one JSON object; null is what is not known, or lies beyond a film's or trial's end, which are counted."""
    quantities = [
        {
            "name": row.quantity.name,
            "unit": row.quantity.unit,
            "film": _finite(row.film),
            "film_is_beyond": math.isinf(row.film),
            "percentile": _finite(row.percentile),
            "is_unusual": row.is_unusual,
            "trials": [_finite(value) for value in row.trials.tolist()],
            "beyond": row.beyond,
            "unknown": row.unknown,
        }
        for row in rows
    ]
    values = {key: each._asdict() for key, each in fitted.items()}
    found = {"film": film, "scenario": scenario, "quantities": quantities, "fitted": values, "versions": versions()}
    print(json.dumps(found), flush=True)


def print_comparison(
    film: str, scenario: str, rows: Sequence[QuantityComparison], fitted: Mapping[str, Fitted]
) -> None:
    """Print readable tables on stdout."""
    console = Console(width=None if sys.stdout.isatty() else WIDE)
    table = Table(title=Text(f"{film} beside trials of {scenario}"), title_justify="left")
    for heading in ("", "unit", "film", "trials: median", "5 % to 95 %", "film's percentile", ""):
        table.add_column(heading, justify="right" if heading else "left")
    for row in rows:
        known = row.trials[~np.isnan(row.trials)]
        low, middle, high = np.quantile(known, (0.05, 0.5, 0.95), method="nearest") if len(known) else [math.nan] * 3
        percentile = "-" if math.isnan(row.percentile) else f"{row.percentile:.0f} %"
        span = f"{_shown(low)} to {_shown(high)}" if len(known) else "-"
        cells = (_shown(row.film), _shown(middle), span, percentile)
        table.add_row(Text(row.quantity.name), row.quantity.unit, *cells, "unusual" if row.is_unusual else "")
    console.print(table)
    values = Table(title="What the film tells of the scenario, with 95 % intervals", title_justify="left")
    for heading in ("key", "value", "interval"):
        values.add_column(heading, justify="right" if heading != "key" else "left")
    for key, each in fitted.items():
        values.add_row(Text(key), f"{each.value:.4g}", f"{each.low:.4g} to {each.high:.4g}")
    console.print(values)
    print(UNTOLD)


def _shown(value: Any) -> str:
    if math.isnan(value):
        return "-"
    return "beyond" if math.isinf(value) else f"{value:.4g}"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
