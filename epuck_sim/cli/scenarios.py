"""The commands about scenarios and other files that users write: `check`, `list` and `new`."""

import json
import keyword
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from epuck_sim.cli.errors import exit_on_error, prefix_scenario, print_warnings, reject_first, word_if_slow
from epuck_sim.cli.options import (
    AxesOption,
    ControllerOption,
    JsonOption,
    QuickOption,
    ScenarioArgument,
    SetOption,
    read_scenario,
)
from epuck_sim.cli.templates import CONTROLLER, MEASURE, ROBOT, SCENARIO, SENSOR
from epuck_sim.util.atomic_write import atomic_write

scenarios = typer.Typer()
news = typer.Typer(no_args_is_help=True, help="Write a commented file to begin with.")


@scenarios.command()
def check(
    scenario: ScenarioArgument,
    settings: SetOption = None,
    axes: AxesOption = None,
    controller: ControllerOption = None,
    quick: QuickOption = False,
) -> None:
    """Validate SCENARIO, with every point of its sweep, and print it with every default written out.

    Comments at its end say how many points and trials it has, and what they take.
    """
    with exit_on_error():
        from epuck_sim.runs.trust import is_trusted, run_folder_of
        from epuck_sim.scenario.loader import RUN_SCENARIO, write_scenario
        from epuck_sim.scenario.points import points
        from epuck_sim.sweep.checks import check_sweep, describe_size

        if (folder := run_folder_of(scenario)) is not None and not is_trusted(folder):
            changed = any((settings, axes, controller, quick))
            reject_first((changed, f"{folder}: brings code that you have not run; only what is stored can be shown"))
            sys.stdout.write((folder / RUN_SCENARIO).read_text(encoding="utf-8", errors="replace"))
            sys.stdout.write("# as it is stored: not checked, as that would run code which you have not run\n")
            return
        loaded = read_scenario(scenario, settings, axes, controller=controller, quick=quick)
        with word_if_slow(f"checking {scenario}"), prefix_scenario(scenario):
            found = points(loaded)
            check_sweep(found)
        sys.stdout.write(f"{write_scenario(loaded)}# {describe_size(found)}\n")


@scenarios.command("list")
def list_shipped(
    measures: Annotated[
        bool, typer.Option("--measures", help="List measures of trials, and their parameters.")
    ] = False,
    as_json: JsonOption = False,
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


class New(NamedTuple):
    """A kind of file that `new` writes."""

    template: str
    """Its text, with {name}."""
    command: str
    """What tries it, with {name} and {file}."""
    example: str
    """A name for one."""


NEW = {
    "scenario": New(SCENARIO, "run {file}", "pillar-80"),
    "controller": New(CONTROLLER, "run thesis --controller {file}", "wanderer"),
    "measure": New(MEASURE, "run thesis --measure {file}", "coverage"),
    "sensor": New(SENSOR, 'run thesis --set "robots.0.sensors=[{file}]" --trace {name}.parquet', "ground"),
    "robot": New(ROBOT, "run thesis --set robot={file}", "cart"),
}
"""The kinds of files that `new` writes."""


def _command_for(kind: str) -> Callable[[str], None]:
    def new(name: Annotated[str, typer.Argument(metavar="NAME", help="Its name, and that of its file.")]) -> None:
        with exit_on_error():
            _write_new(kind, name)

    new.__doc__ = f"Write a file with a commented {kind} that runs as it stands."
    return new


for kind_of_file in NEW:
    news.command(kind_of_file)(_command_for(kind_of_file))


def _write_new(kind: str, name: str) -> None:
    new = NEW[kind]
    if kind == "scenario":
        is_name, letters = re.fullmatch(r"[A-Za-z_][\w-]{0,99}", name) is not None, "letters, digits, _ and -"
    else:  # which Python imports, or which stands beside what it does
        is_name = name.isidentifier() and not keyword.iskeyword(name) and not name.startswith("_")
        letters = "letters, digits and _"
    file = f"{name}.yaml" if kind in ("scenario", "robot") else f"{name}.py"
    from epuck_sim.control.interface import Sensors

    taken = kind == "sensor" and (name in Sensors._fields or name in sys.stdlib_module_names)
    reject_first(
        (not is_name, f"{name!r} is no name for a {kind}; allowed: {letters}, such as {new.example}"),
        (taken, f"{name!r} is taken, by what robots sense anyway or by Python; give another name"),
        (Path(file).exists(), f"{file}: exists already; give another name"),
    )
    with atomic_write(Path(file)) as part:
        part.write_text(new.template.format(name=name), encoding="utf-8")
    typer.echo(f"{file}: try it: epuck-sim {new.command.format(name=name, file=file)}")
