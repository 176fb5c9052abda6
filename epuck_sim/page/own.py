"""Compiles what a scenario's own files have for its page: a module of WebAssembly beside the model's, in its memory.

Controllers, sensors and response curves in files of their own are kernels as shipped ones are. A process of its own
compiles them, as it makes all code for another machine from then on; ziglang links them.
"""

import gzip
import tempfile
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path

from epuck_sim.control.interface import Sensor
from epuck_sim.control.loader import find_controller, find_sensor
from epuck_sim.errors import ScenarioError
from epuck_sim.page.build import compile_kernels, link
from epuck_sim.page.roots import Root, controller_root, curve_root, sensor_root
from epuck_sim.particles.phase_response import CURVES
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.builtin import CONTROLLERS, builtin_files

FIRST_BYTE = 18 * 2**20  # of the module's part of the memory: behind what the model's module has from its start on
BYTES = 2**20  # size of that part: its constants, its stack, and what its functions allocate
STACK_BYTES = 2**18

PLACED = (
    *("-Wl,--import-memory", f"-Wl,--initial-memory={FIRST_BYTE + BYTES}"),
    f"-Wl,-z,stack-size={FIRST_BYTE + STACK_BYTES}",  # which grows down from there, and constants stand behind it
)
"""Options of the linker that put a module in its place."""

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
        return {} if scenario.response.curve in CURVES else {CURVE: curve_root(scenario.response)}
    groups = scenario.robots
    found = {
        root: controller_root(find_controller(groups[number].controller), _sensors_of(groups[number]))
        for number, root in own_controllers(scenario).items()
    }
    return found | {root: sensor_root(sensor) for sensor, root in own_sensors(scenario).items()}


def compile_own(scenario: EmbodiedScenario | ParticleScenario) -> bytes:
    """Return the module of a scenario's own files, gzipped; nothing if there are none.

    ScenarioError is raised without ziglang, and for a file that calls what pages do not have.
    """
    if not own_roots(scenario):
        return b""
    if find_spec("ziglang") is None:
        what = "controllers, sensors and response curves in files are compiled for a page by ziglang"
        raise ScenarioError(f'{scenario.name}: {what}: pip install "epuck-sim[page]"')
    try:
        with ProcessPoolExecutor(1, get_context("spawn")) as executor:
            return executor.submit(_compile, scenario).result()
    except BrokenProcessPool as error:
        said = "begin it with `if __name__ == '__main__':`, as it is imported where the page's files are compiled"
        raise ScenarioError(f"{scenario.name}: what writes the page in your script must stand below; {said}") from error


def _compile(scenario: EmbodiedScenario | ParticleScenario) -> bytes:
    roots = own_roots(scenario)
    with tempfile.TemporaryDirectory() as folder:
        return gzip.compress(link(compile_kernels(roots), roots, Path(folder), *PLACED), 9, mtime=0)
