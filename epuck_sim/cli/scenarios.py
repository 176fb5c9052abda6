"""The commands that read scenarios: `check` and `list`; and the options that name and change a scenario."""

import sys
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, prefix_scenario, print_warnings

scenarios = typer.Typer()

ScenarioArgument = Annotated[
    str, typer.Argument(help="A YAML file, a shipped scenario's name (see `list`), or a run folder to go on with.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value: robots.0.parameters.speed_cm_s=1.0"),
]
TrialsOption = Annotated[
    int | None,
    typer.Option(min=1, max=10_000_000, help="Trials at each point; the scenario's own number by default."),
]
AxesOption = Annotated[
    list[str] | None,
    typer.Option("--sweep", metavar="KEY=V1,V2,...", help="Add an axis to the sweep: robots.0.count=5,10,20"),
]
MeasureOption = Annotated[
    list[str] | None,
    typer.Option(
        "--measure", metavar="NAME_OR_FILE", help="Measure more: order_parameter, mine.py:coverage (list --measures)"
    ),
]
ControllerOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME_OR_FILE", help="Run this controller on all robots; parameters that it has are kept: mine.py"
    ),
]
QuickOption = Annotated[bool, typer.Option("--quick", help="Take the scenario's quick version, if it has one.")]


@scenarios.command()
def check(
    scenario: ScenarioArgument,
    settings: SetOption = None,
    axes: AxesOption = None,
    controller: ControllerOption = None,
    quick: QuickOption = False,
) -> None:
    """Validate SCENARIO, with every point of its sweep, and print it with every default written out."""
    with exit_on_error():
        from epuck_sim.scenario.loader import load_scenario, write_scenario
        from epuck_sim.scenario.points import points
        from epuck_sim.sweep.checks import check_sweep

        with print_warnings():
            loaded = load_scenario(scenario, settings or (), axes or (), controller=controller, quick=quick)
        with prefix_scenario(scenario):
            check_sweep(points(loaded))
        sys.stdout.write(write_scenario(loaded))


@scenarios.command("list")
def list_shipped(
    measures: Annotated[
        bool, typer.Option("--measures", help="List measures of trials, and their parameters.")
    ] = False,
) -> None:
    """List the scenarios, sweeps and controllers, or the measures, that come with epuck-sim."""
    with exit_on_error():
        from epuck_sim.cli.listing import print_measures, print_shipped

        if measures:
            print_measures()
        else:
            print_shipped()
