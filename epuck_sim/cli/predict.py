"""The command `predict`: what follows from who hears whom, before any trial."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from epuck_sim.cli.errors import exit_on_error, prefix_scenario, word_if_slow
from epuck_sim.cli.options import (
    AxesOption,
    JsonOption,
    QuickOption,
    ScenarioArgument,
    SetOption,
    read_scenario,
)

if TYPE_CHECKING:  # or --help would wait for pydantic
    from epuck_sim.display.table import Table
    from epuck_sim.scenario.points import Point
    from epuck_sim.theory.predict import Prediction

predictions = typer.Typer()


@predictions.command()
def predict(
    scenario: ScenarioArgument,
    settings: SetOption = None,
    axes: AxesOption = None,
    quick: QuickOption = False,
    as_json: JsonOption = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print a row a point as CSV.")] = False,
) -> None:
    """Predict regimes and T_sync of SCENARIO from who hears whom, without a trial; of a sweep, a row a point."""
    with exit_on_error():
        loaded = read_scenario(scenario, settings, axes, quick=quick)
        from epuck_sim.cli.tables import show
        from epuck_sim.theory.predict import predict_points

        with word_if_slow(f"predicting {scenario}"), prefix_scenario(scenario):
            found = predict_points(loaded)
        if loaded.sweep is not None:
            records = [{"axes": point.axes, **prediction._asdict()} for point, prediction in found]
            show(
                [_table_of_points(loaded.name, found)],
                {"scenario": loaded.name, "points": records},
                as_json=as_json,
                as_csv=as_csv,
            )
        else:
            show([_table(found[0][1])], found[0][1], as_json=as_json, as_csv=as_csv)


def _table_of_points(name: str, found: "Sequence[tuple[Point, Prediction]]") -> "Table":
    from epuck_sim.display.table import Row, Table

    rows = [Row(point.axes, _cells(prediction)) for point, prediction in found]
    notes = dict.fromkeys(note for _, prediction in found for note in prediction.notes)
    return Table(name, rows, tuple(notes), {"v_m": "V_m cm/s", "v_p": "V_p cm/s"})


def _cells(found: "Prediction") -> dict[str, Any]:
    """Return the cells of a row for a point of a sweep."""
    from epuck_sim.display.table import Share

    return {
        "regime": found.intermediate_regime.verdict,
        "probability": Share(found.intermediate_regime.probability),
        "v_m": found.v_m_cm_s,
        "v_p": found.v_p_cm_s,
        "t_sync": found.t_sync,
        "t_fast": found.t_sync_fast,
        "t_frozen": found.t_sync_frozen,
        "frozen_share": Share(found.frozen_share.value),
    }


def _table(found: "Prediction") -> "Table":
    """Return the prediction of one scenario, a quantity a line."""
    from epuck_sim.display.table import Row, Share, Table

    graph, regime = found.graph, found.intermediate_regime
    rows: list[tuple[str, Any, str]] = [
        ("intermediate regime", regime.verdict, ""),
        ("its probability", Share(regime.probability), ""),
        ("V_m, minimum of T_sync", found.v_m_cm_s, "cm/s"),
        ("V_p, peak of T_sync", found.v_p_cm_s, "cm/s"),
        ("T_sync at this speed", found.t_sync, "cycles"),
        ("T_sync, fast limit", found.t_sync_fast, "cycles"),
        ("T_sync, standing swarms", found.t_sync_frozen, "cycles"),
        ("standing swarms that can", Share(found.frozen_share.value), ""),
        ("link lasts", found.link_cm, "cm"),
        ("link lasts", found.link_cycles, "cycles"),
        ("links an agent", graph.links, ""),
        ("reciprocal links", Share(graph.reciprocity.value), ""),
        ("heard, hear nobody", Share(graph.sources.value), ""),
        ("frustrated clusters", Share(graph.frustrated.value), "of snapshots"),
    ]
    made = [Row({}, {"quantity": name, "predicted": value, "unit": unit}) for name, value, unit in rows]
    return Table(found.scenario, made, (found.reason, *found.notes))
