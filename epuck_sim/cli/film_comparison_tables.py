"""What `epuck-sim compare-film` prints: a film compared with trials, and what the film determines."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from epuck_sim.cli.tables import show
from epuck_sim.display.table import Row, Share, Table
from epuck_sim.estimate import Estimate, significant
from epuck_sim.overhead.compare import Fitted, QuantityComparison, judge
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
            "trials": [_finite(value) for value in row.trials.tolist()],
            "beyond": row.beyond,
            "unknown": row.unknown,
        }
        for row in rows
    ]
    values = {key: each._asdict() for key, each in fitted.items()}
    verdict = judge(rows)
    judged = {**verdict._asdict(), "p_value": _finite(verdict.p_value)}
    found = {
        "film": film,
        "scenario": scenario,
        "verdict": judged,
        "quantities": quantities,
        "fitted": values,
        "versions": versions(),
    }
    print(json.dumps({**found, "versions": versions()}), flush=True)


def print_comparison(
    film: str, scenario: str, rows: Sequence[QuantityComparison], fitted: Mapping[str, Fitted]
) -> None:
    """Print the verdict, and readable tables, on stdout."""
    verdict = judge(rows)
    for sentence in filter(None, (verdict.caution, verdict.sentence)):
        print(f"{sentence[0].upper()}{sentence[1:]}.")
    print()
    headings = {"trials": "trials: median, 5 % and 95 %", "percentile": "film's percentile"}
    title = f"{film} beside trials of {scenario}"
    compared = Table(title, [Row({}, _cells(row)) for row in rows], (), headings)
    values = [Row({}, {"key": key, "value": Estimate(*each)}) for key, each in fitted.items()]
    told = Table("What the film tells of the scenario, with 95 % intervals", values, [UNTOLD])
    show([compared, told], None, as_json=False)


def _cells(row: QuantityComparison) -> dict[str, Any]:
    known = row.trials[~np.isnan(row.trials)]
    low, middle, high = [math.nan] * 3
    if len(known):
        low, middle, high = np.quantile(known, (0.05, 0.5, 0.95), method="nearest").tolist()
    return {
        "quantity": row.quantity.name,
        "unit": row.quantity.unit,
        "film": "beyond" if math.isinf(row.film) else significant(row.film),
        "trials": Estimate(middle, low, high),
        "percentile": Share(row.percentile / 100),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
