"""The kernels that pages run: a WebAssembly module for each model, made once, for every scenario.

A module has the kernels that a page calls, or that other kernels call by address. `build` makes it, into a folder
beside this file, with a digest of its sources. Kernels keep their names in it. A function that a swarm calls has a
number in an array of addresses, as in the program; in a page, an address is an index in the module's table of
functions.
"""

import ast
import hashlib
import inspect
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, Literal

import numpy as np
from numba import types

from epuck_sim.control.compilation import jit_functions
from epuck_sim.control.interface import Controller, Sensor
from epuck_sim.control.loader import find_controller, find_sensor
from epuck_sim.embodied import loop, start, user_code
from epuck_sim.embodied.bodies import chipmunk
from epuck_sim.embodied.own_sensors import run_sensor
from epuck_sim.embodied.sensors import camera
from epuck_sim.errors import EpuckSimError
from epuck_sim.particles import events, initial_conditions, motion, neighbours, phase_response
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario, ResponseSection, find_curve
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util import elementary, generators
from epuck_sim.util.builtin import CONTROLLERS, builtin_files
from epuck_sim.util.jit import bind
from epuck_sim.util.native import ADDRESSES, BLOCK, compile_part

Model = Literal["particles", "embodied"]

FOLDER = Path(__file__).parent / "wasm"  # where the modules lie, gzipped, each with its digest

ANEW = "make it anew: make wasm"

WORDS, ROWS = types.Array(types.uint64, 1, "C"), types.Array(types.float64, 2, "C")

Root = tuple[Any, tuple[Any, ...]]  # a kernel, and the types of its arguments

_SWARM = BLOCK, ADDRESSES
_OF_AGENT = *_SWARM, types.int64, types.float64
_OF_GROUP = *_SWARM, types.int64
_OF_CURVE = BLOCK, types.float64

_SEEDS: tuple[Root, ...] = (
    (generators.begin_sequence, (WORDS, WORDS)),
    (generators.spawn, (WORDS, WORDS, types.int64)),
    (generators.draw_words, (WORDS, WORDS)),
)

_AGENTS: tuple[Root, ...] = (
    (initial_conditions.start, (*_SWARM, WORDS)),
    (motion.begin_motion, (BLOCK,)),
    *((kernel, _SWARM) for kernel in (events.advance, events.observe)),
    *((kernel, _OF_AGENT) for kernel in (motion.continue_trajectory, motion.begin_run, motion.reorient_agents)),
    *((kernel, _OF_AGENT) for kernel in (neighbours.search_nearest, neighbours.search_cone)),
    *((kernel, _OF_AGENT) for kernel in (neighbours.search_cells, neighbours.draw_receivers)),
)

_ROBOTS: tuple[Root, ...] = (
    (start.draw_all, (BLOCK, WORDS, WORDS)),
    (start.vary, (BLOCK,)),
    (start.begin_placement, (BLOCK,)),
    *((kernel, (BLOCK, types.int64, types.int64)) for kernel in (start.place_on_grid, start.place_at_random)),
    (camera.begin_pictures, (BLOCK, types.int64)),
    (elementary.add_directions, (ROWS, ROWS)),
    (chipmunk.place, _SWARM),
    (chipmunk.rest, _OF_GROUP),
    (loop.take_steps, (*_SWARM, types.int64, types.boolean)),
    *((kernel, _OF_GROUP) for kernel in (loop.tick, loop.stop_and_release, *loop.SENSORS)),
)


def read_module(model: Model) -> bytes:
    """Return the WebAssembly of a model, gzipped; raise EpuckSimError if it has not been made."""
    path = FOLDER / f"{model}.wasm.gz"
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise EpuckSimError(f"{path}: is missing; {ANEW}") from error


def roots(model: Model) -> Mapping[str, Root]:
    """Return the kernels of a model's module by their names in it."""
    of_model = _AGENTS if model == "particles" else _ROBOTS
    named = {kernel.function.__name__: (kernel, arguments) for kernel, arguments in _SEEDS + of_model}
    if model == "embodied":
        named |= {shipped_root(name): controller_root(find_controller(name)) for name in builtin_files(CONTROLLERS)}
    return named


def shipped_root(name: str) -> str:
    """Return the name of the function that runs a shipped controller."""
    return f"run_{name}"


def controller_root(controller: Controller, sensors: tuple[Sensor, ...] = ()) -> Root:
    """Return the function (block, addresses, group) that runs a controller, whose group has `sensors` in files."""
    functions = {"start": controller.start, "step": controller.step}
    values = {
        "MEMORY": controller.memory,
        "PARAMETERS": controller.parameter_type,
        "gather": user_code.gatherer(sensors),
    }
    return _kernel_of(controller, user_code.run_group, functions, values), _OF_GROUP


def sensor_root(sensor: Sensor) -> Root:
    """Return the function (block, addresses, sense) that reads a sensor for a group, as `OwnSensor` does."""
    values = {"READINGS": sensor.readings, "PARAMETERS": sensor.parameter_type}
    return _kernel_of(sensor, run_sensor, {"sense": sensor.sense}, values), _OF_GROUP


def curve_root(response: ResponseSection) -> Root:
    """Return the function (bytes, phase) of a user's response curve."""
    curve = find_curve(response.curve)
    values = {"_PARAMETERS": curve.parameter_type}
    return _kernel_of(curve, phase_response.shift_at, {"_shift": curve.phase_shift}, values), _OF_CURVE


def _kernel_of(user: Any, function: Any, functions: Mapping[str, Any], values: Mapping[str, Any]) -> Any:
    """Return a function that calls those of a user's file, as a kernel with Python's errors and checked indices."""
    compiled = dict(zip(functions, jit_functions(functions.values(), user.modules, user.name), strict=True))
    bound = bind(function, **compiled, **values)
    return SimpleNamespace(function=bound, part=compile_part(bound, error_model="python", boundscheck=True))


CURVE = "run_curve"


def own_controllers(scenario: EmbodiedScenario) -> dict[int, str]:
    """Return the kernels' names by the numbers of groups with controllers, or sensors, in files of their own."""
    shipped = builtin_files(CONTROLLERS)
    own = [number for number, each in enumerate(scenario.robots) if each.sensors or each.controller not in shipped]
    return {number: f"run_group_{number}" for number in own}


def own_sensors(scenario: EmbodiedScenario) -> dict[Sensor, str]:
    """Return the kernels' names by the sensors in files of their own; groups may give one name to different files."""
    found = dict.fromkeys(sensor for group in scenario.robots for sensor in _sensors_of(group))
    return {sensor: f"sense_{number}" for number, sensor in enumerate(found)}


def _sensors_of(group: RobotGroup) -> tuple[Sensor, ...]:
    return tuple(find_sensor(each["file"]) for each in group.sensors.values())


def own_roots(scenario: EmbodiedScenario | ParticleScenario) -> dict[str, Root]:
    """Return the kernels that a page of a scenario needs beside those of its model."""
    if isinstance(scenario, ParticleScenario):
        return {} if scenario.response.curve in phase_response.CURVES else {CURVE: curve_root(scenario.response)}
    groups = scenario.robots
    found = {
        root: controller_root(find_controller(groups[number].controller), _sensors_of(groups[number]))
        for number, root in own_controllers(scenario).items()
    }
    return found | {root: sensor_root(sensor) for sensor, root in own_sensors(scenario).items()}


BUILDERS = ("build.py", "chipmunk.c")  # files that decide how a module is made


def digest_kernels(model: Model) -> str:
    """Return a digest of a model's kernels, all that they call, and the values of the package that they use."""
    made, seen = hashlib.sha256(), set[Any]()
    for name in BUILDERS:
        made.update(Path(__file__).with_name(name).read_bytes())
    for name, (kernel, arguments) in sorted(roots(model).items()):
        made.update(f"{name} {arguments}".encode())
        for text in meanings(kernel.function, seen):
            made.update(text.encode())
    return made.hexdigest()[:16]


def meanings(function: Any, seen: set[Any]) -> Iterator[str]:
    """Yield the texts that define a compiled function: its source without comments and docstring, and all it names.

    Functions in `seen` are not visited again; each one that is visited is added.
    """
    if function in seen:
        return
    seen.add(function)
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    (definition,) = tree.body
    assert isinstance(definition, ast.FunctionDef)
    if ast.get_docstring(definition) is not None:
        del definition.body[0]
    yield ast.unparse(definition)
    names = function.__code__.co_names
    for name in sorted(names):
        value = function.__globals__.get(name)
        for each in (vars(value).get(inner) for inner in names) if isinstance(value, ModuleType) else (value,):
            called = getattr(each, "function", getattr(each, "py_func", None))  # of a kernel, or a controller's
            if isinstance(called, FunctionType):
                yield from meanings(called, seen)
            elif isinstance(each, int | float | tuple | np.generic | np.ndarray | np.dtype):
                yield f"{name} = {each!r}"
            elif places := getattr(each, "places", None):  # of a part of a block
                yield f"{name} at {places!r}"
