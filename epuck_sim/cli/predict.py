"""The command `predict`: what follows from who hears whom, before any trial."""

from typing import Annotated

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
        from epuck_sim.theory.predict import predict_points, table_of_points

        with word_if_slow(f"predicting {scenario}"), prefix_scenario(scenario):
            found = predict_points(loaded)
        is_sweep = loaded.sweep is not None
        of_points = table_of_points(loaded.name, found)
        records = [{"axes": point.axes, **prediction.record()} for point, prediction in found]
        printed = {"scenario": loaded.name, "points": records} if is_sweep else found[0][1].record()
        table = of_points if is_sweep or as_csv else found[0][1].table()
        show([table], printed, as_json=as_json, as_csv=as_csv)
