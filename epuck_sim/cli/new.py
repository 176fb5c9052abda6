"""The command `new`: writes a commented file to begin with."""

import keyword
import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.cli.templates import CONTROLLER, MEASURE, ROBOT, SCENARIO, SENSOR

news = typer.Typer(no_args_is_help=True, help="Write a commented file to begin with.")


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
    path.write_text(text, encoding="utf-8")
    typer.echo(f"{path}: try it: epuck-sim {command}")
