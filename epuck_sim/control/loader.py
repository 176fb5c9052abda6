"""Controllers and sensors from files: finds the file, loads it and checks that it describes one."""

import keyword
import sys
from dataclasses import replace
from functools import partial
from inspect import isasyncgenfunction, iscoroutinefunction, isgeneratorfunction, signature
from pathlib import Path

import numpy as np

from epuck_sim.control.firmware import load_firmware
from epuck_sim.control.interface import EXTERNAL, Controller, RobotCode, Sensor, Sensors
from epuck_sim.control.names import ARGUMENTS, DRAW, check_draws, check_own_names
from epuck_sim.errors import ControllerError
from epuck_sim.user_files import AS_LOADED, Kind, Place, PythonFile, fingerprint, kept, load_python_file
from epuck_sim.util.builtin import CONTROLLERS, builtin_files, builtin_folder
from epuck_sim.util.messages import comma_list, short_repr

CONTROLLER = Kind(
    noun="controller",
    error=ControllerError,
    suffixes=(".py", ".c", ".so"),  # Python, firmware in C, and the library that it was compiled to
    group="epuck_sim.controllers",
    shipped=partial(builtin_files, CONTROLLERS),
)
"""How controllers are found."""


def find_controller(name: str, folder: Path | None = None) -> Controller:
    """Return a controller: a shipped one, an installed package's, or a file's (.py, .c, .so); see `Kind.locate`."""
    return _load(CONTROLLER.locate(name, folder))


def load_controller(path: str | Path) -> Controller:
    """Return the controller that a file describes, read again only when it, or a file that it imports, has changed."""
    return _load(CONTROLLER.at(Path(path)))


@kept
def _load(place: Place) -> Controller:
    if place.path is not None and place.path.suffix != ".py":
        if place.path.suffix not in CONTROLLER.suffixes:
            raise ControllerError(f"{place.path}: is no controller; allowed: files that end in .py, .c or .so")
        return load_firmware(place.path)
    file = load_python_file(place, ControllerError, (builtin_folder(CONTROLLERS),))
    _check_parts(file, "a controller", "PARAMETERS", "MEMORY", "start", "step")
    parts, external = file.parts, file.parts.get("EXTERNAL", ())
    if not isinstance(external, tuple) or any(part not in EXTERNAL for part in external):
        said = f"EXTERNAL is {short_repr(external)}; allowed: a tuple of {comma_list(EXTERNAL)}"
        raise file.refusal("EXTERNAL", said)
    controller = Controller(
        **vars(describe_code(place, file)),
        memory=file.record_type("MEMORY"),
        start=parts["start"],
        step=parts["step"],
        external=external,
    )
    if controller.has_phase and type(period_s := controller.parameters.get("period_s")) is int:
        controller = replace(controller, parameters={**controller.parameters, "period_s": float(period_s)})
    check_own_names(controller)
    check_draws(file, DRAW)
    return controller


def _check_parts(file: PythonFile, noun: str, *parts: str) -> None:
    for part in parts:
        found, takes = file.parts.get(part), ARGUMENTS.get(part)
        if takes is None:
            if not isinstance(found, dict):
                values = "default values" if part == "PARAMETERS" else "types"
                raise file.refusal(part, f"{noun} needs {part}: a mapping of names to {values}")
            continue
        if not callable(found):
            raise file.refusal(part, f"{noun} needs {part}: a function {part}({', '.join(takes)})")
        if any(runs_late(found) for runs_late in (isgeneratorfunction, iscoroutinefunction, isasyncgenfunction)):
            raise file.refusal(part, f"{part} has yield or async, with which nothing in it would run; write it without")
        try:
            arguments = signature(found, follow_wrapped=False)
        except ValueError:  # of what is compiled already
            continue
        try:
            arguments.bind(*takes)
        except TypeError:
            said = f"{part} takes {len(arguments.parameters)} arguments; allowed: {', '.join(takes)}"
            raise file.refusal(part, said) from None


def describe_code(place: Place, file: PythonFile) -> RobotCode:
    """Return the part of a controller, a sensor or a response curve that all of them have, from its file."""
    given = file.parameters(), file.check(), file.sources, file.modules
    return RobotCode(place.short_name, place.name, file.path, *given)


SENSOR = Kind(noun="sensor", error=ControllerError, suffixes=(".py",), group="epuck_sim.sensors", shipped=dict)
"""How sensors in files of their own are found."""


def find_sensor(name: str, folder: Path | None = None) -> Sensor:
    """Return a sensor: an installed package's, or a file's (.py); see `Kind.locate`."""
    return _load_sensor(SENSOR.locate(name, folder))


@kept
def _load_sensor(place: Place) -> Sensor:
    file = load_python_file(place, ControllerError)
    _check_parts(file, "a sensor", "READINGS", "sense")
    sense = file.parts["sense"]
    if not file.parts["READINGS"]:
        raise file.refusal("READINGS", "READINGS has no reading; allowed: at least one")
    for name in file.parts["READINGS"]:
        if name in Sensors._fields:
            raise file.refusal("READINGS", f"READINGS: {name!r} is a reading of all robots; choose another")
        if keyword.iskeyword(name) or str(name).startswith("_"):
            raise file.refusal("READINGS", f"READINGS: {name!r} is no name that `sensors` can have; choose another")
    readings = file.record_type("READINGS", most=10_000)
    names = sorted(readings.names or (), key=lambda name: readings[name].base.kind != "f")
    # floats come before whole numbers, so that they can be viewed as one array
    ordered = np.dtype([(name, readings[name].base, readings[name].shape) for name in names], align=True)
    if "file" in file.parameters():
        raise file.refusal("PARAMETERS", "PARAMETERS: 'file' is the key of the sensor's file; choose another")
    sensor = Sensor(**vars(describe_code(place, file)), readings=ordered, sense=sense)
    check_own_names(sensor)
    check_draws(file, DRAW)
    return sensor


def check_imported_copies(controller: RobotCode) -> None:
    """Reject values that the program set in its own import of a controller's file, which controllers do not see."""
    for path, own in controller.modules.items():
        imported = sys.modules.get(path.stem)
        if imported is None or Path(getattr(imported, "__file__", None) or "").resolve() != path:
            continue
        loaded = vars(own)[AS_LOADED]
        for name, value in vars(imported).items():
            if not name.startswith("__") and name.isidentifier() and fingerprint(value) != loaded.get(name):
                said = f"{name} is {short_repr(value)} in the module {path.stem!r} of this program"
                why = "which is not what the file says; controllers run their own copy, which this does not change"
                instead = "make it a parameter, or set it in the modules of `epuck_sim.control.loader.find_controller`"
                raise ControllerError(f"{path}: {said}, {why}: {instead}")
