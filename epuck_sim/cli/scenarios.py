"""The commands about scenarios and other files that users write: `check`, `list` and `new`."""

import json
import keyword
import re
import sys
from pathlib import Path
from typing import Annotated

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


@news.command("measure")
def new_measure(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the measure, and of its file NAME.py.")],
) -> None:
    """Write NAME.py, a commented measure of trials that runs as it stands."""
    with exit_on_error():
        _reject_no_name(name, "measure", "coverage")
        _write_new(Path(f"{name}.py"), MEASURE.format(name=name), f"run thesis --measure {name}.py")


@news.command("controller")
def new_controller(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the controller's file NAME.py.")],
) -> None:
    """Write NAME.py, a commented controller of robots that runs as it stands."""
    with exit_on_error():
        _reject_no_name(name, "controller", "wanderer")
        _write_new(Path(f"{name}.py"), CONTROLLER.format(name=name), f"run thesis --controller {name}.py")


@news.command("sensor")
def new_sensor(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the sensor, and of its file NAME.py.")],
) -> None:
    """Write NAME.py, a commented sensor of robots that runs as it stands."""
    with exit_on_error():
        from epuck_sim.control.interface import Sensors

        _reject_no_name(name, "sensor", "ground")
        taken = name in Sensors._fields or name in sys.stdlib_module_names
        reject_first((taken, f"{name!r} is taken, by what robots sense anyway or by Python; give another name"))
        command = f'run thesis --set "robots.0.sensors=[{name}.py]" --trace {name}.parquet'
        _write_new(Path(f"{name}.py"), SENSOR.format(name=name), command)


@news.command("robot")
def new_robot(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the robot's file NAME.yaml.")],
) -> None:
    """Write NAME.yaml, a commented robot that runs as it stands."""
    with exit_on_error():
        _reject_no_name(name, "robot", "cart")
        _write_new(Path(f"{name}.yaml"), ROBOT.format(name=name), f"run thesis --set robot={name}.yaml")


@news.command("scenario")
def new_scenario(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the scenario, and of its file NAME.yaml.")],
) -> None:
    """Write NAME.yaml, a commented scenario that runs as it stands."""
    with exit_on_error():
        message = f"{name!r} is no name for a scenario; allowed: letters, digits, _ and -, such as pillar-80"
        reject_first((not re.fullmatch(r"[A-Za-z_][\w-]{0,99}", name), message))
        _write_new(Path(f"{name}.yaml"), SCENARIO.format(name=name), f"run {name}.yaml")


def _reject_no_name(name: str, kind: str, example: str) -> None:
    """Raise EpuckSimError for what Python cannot import by this name."""
    is_name = name.isidentifier() and not keyword.iskeyword(name) and not name.startswith("_")
    reject_first((not is_name, f"{name!r} is no name for a {kind}; allowed: letters, digits and _, such as {example}"))


def _write_new(path: Path, text: str, command: str) -> None:
    """Write a file that does not exist yet, and print how to try it."""
    reject_first((path.exists(), f"{path}: exists already; give another name"))
    with atomic_write(path) as part:
        part.write_text(text, encoding="utf-8")
    typer.echo(f"{path}: try it: epuck-sim {command}")
