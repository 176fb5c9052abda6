"""The commands that read scenarios: `check` and `list`; and the options that name and change a scenario."""

import json
import sys
from typing import Annotated

import typer

from epuck_sim.cli.completion import complete_controller, complete_measure, complete_scenario
from epuck_sim.cli.errors import exit_on_error, prefix_scenario, print_warnings

scenarios = typer.Typer()

SCENARIO_PANEL = "Scenario"
"""Heading, in the help, of the options that change a scenario."""

ScenarioArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="A YAML file, a scenario's name (see `list`), or a run folder to go on with.",
        autocompletion=complete_scenario,
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change one value, such as robots.0.count=5; repeatable.",
        rich_help_panel=SCENARIO_PANEL,
    ),
]
TrialsOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=10_000_000,
        help="Trials at each point; the scenario's own number by default.",
        rich_help_panel=SCENARIO_PANEL,
    ),
]
AxesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--sweep",
        metavar="KEY=V1,V2,...",
        help="Add an axis to the sweep, such as robots.0.count=5,10,20; repeatable.",
        rich_help_panel=SCENARIO_PANEL,
    ),
]
MeasureOption = Annotated[
    list[str] | None,
    typer.Option(
        "--measure",
        metavar="NAME_OR_FILE",
        help="Measure more, such as order_parameter or mine.py:coverage; repeatable; see `list --measures`.",
        rich_help_panel=SCENARIO_PANEL,
        autocompletion=complete_measure,
    ),
]
ControllerOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME_OR_FILE",
        help="Run this controller on all robots, such as mine.py; parameters that it has are kept.",
        rich_help_panel=SCENARIO_PANEL,
        autocompletion=complete_controller,
    ),
]
QuickOption = Annotated[
    bool,
    typer.Option("--quick", help="Take the scenario's quick version, if it has one.", rich_help_panel=SCENARIO_PANEL),
]


@scenarios.command()
def check(
    scenario: ScenarioArgument,
    settings: SetOption = None,
    axes: AxesOption = None,
    controller: ControllerOption = None,
    quick: QuickOption = False,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--time",
            metavar="SECONDS",
            min=0.1,
            max=3600,
            help="Time some trials for this long, and say how long all of them will take.",
        ),
    ] = None,
) -> None:
    """Validate SCENARIO, with every point of its sweep, and print it with every default written out.

    Comments at its end say how many points and trials it has, and what they take.
    """
    with exit_on_error():
        from epuck_sim.cli.progress import word_if_slow
        from epuck_sim.cli.sweep_size import describe_size
        from epuck_sim.scenario.loader import load_scenario, write_scenario
        from epuck_sim.scenario.points import points
        from epuck_sim.sweep.checks import check_sweep

        with word_if_slow(f"checking {scenario}"):
            with print_warnings():
                loaded = load_scenario(scenario, settings or (), axes or (), controller=controller, quick=quick)
            with prefix_scenario(scenario):
                found = points(loaded)
                check_sweep(found)
            text = write_scenario(loaded)
        notes = [describe_size(found)]
        if seconds is not None:
            from epuck_sim.cli.plan import estimate_duration
            from epuck_sim.cli.plan_tables import describe_computing
            from epuck_sim.sweep.executors import available_cores

            with prefix_scenario(scenario):
                notes.extend(describe_computing(estimate_duration(found, loaded.trials, seconds, available_cores())))
        sys.stdout.write(text + "".join(f"# {note}\n" for note in notes))


@scenarios.command("list")
def list_shipped(
    measures: Annotated[
        bool, typer.Option("--measures", help="List measures of trials, and their parameters.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON: names and descriptions, by kind.")] = False,
) -> None:
    """List scenarios, sweeps and controllers, or measures: those of epuck-sim, and those of installed packages."""
    with exit_on_error():
        from epuck_sim.cli.listing import list_measures, list_names, print_descriptions

        with print_warnings():
            listed = list_measures() if measures else list_names()
        if as_json:
            print(json.dumps(listed, ensure_ascii=False, indent=2))
        else:
            print_descriptions(listed)
