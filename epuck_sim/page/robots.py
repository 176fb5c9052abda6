"""Facts of a scenario of robots for its page: blocks as the program makes them, and the places of fields in them."""

import base64
import math
from collections.abc import Mapping
from contextlib import suppress
from itertools import groupby
from typing import Any

import numpy as np

from epuck_sim.arena import Arena, floor_levels
from epuck_sim.control.firmware import Firmware
from epuck_sim.control.loader import find_controller
from epuck_sim.embodied.bodies import chipmunk
from epuck_sim.embodied.bodies.contacts import MARGIN_CM
from epuck_sim.embodied.bodies.world import WALL_CM
from epuck_sim.embodied.cells import count_cells
from epuck_sim.embodied.own_sensors import OwnSensor
from epuck_sim.embodied.sensors.camera import set_camera
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.swarm import CAMERA, GROUP, RAY, ROBOT, SCENE, Swarm
from epuck_sim.embodied.user_code import GroupControllers
from epuck_sim.errors import ScenarioError
from epuck_sim.page.roots import own_controllers, own_sensors, shipped_root
from epuck_sim.page.settings import Setting, allowed, fields_of, refuse, stops
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import with_values
from epuck_sim.scenario.robot_kind import cell_cm
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.trial.embodied import NOMINAL_PERIOD_S

MOST_ROBOTS = 200  # most robots of a page
FLOOR_CELLS, PICTURE_CELLS = 160, 60  # cells along the longer side of a drawn floor, and of one that has a picture
COUNTS = (*range(1, 21), 25, 30, 40, 50)  # numbers of robots on a slider; each has a block of its own in the page
VIEWS_DEG = (20, 30, 40, 56, 70, 90, 120, 150, 180, 240, 300, 360)
"""Fields of view on a slider; the directions of a camera's pixels are computed here, to the bit."""

PARAMETERS: Mapping[str, tuple[str, str, tuple[Any, ...]]] = {
    "speed_cm_s": ("speed", "cm/s", stops(0.1, 12.8)),
    "coupling": ("coupling", "", stops(0, 1, step=0.01)),
    "period_s": ("period", "s", stops(1, 10, step=0.5)),
    "refractory_fraction": ("refractory, share of the period", "", stops(0, 0.6, step=0.01)),
}
"""Parameters of controllers that have a slider, with label, unit and stops."""


def check_robots(scenario: EmbodiedScenario) -> None:
    """Raise ScenarioError, which names the key, if a scenario of robots cannot be a page."""
    controllers = [find_controller(group.controller) for group in scenario.robots]
    unfit = [each.name for each in controllers if each.external or isinstance(each, Firmware)]
    commanded = f"is {''.join(unfit[:1])}; pages run controllers in Python, without commands from outside"
    refuse(
        scenario,
        (scenario.population > MOST_ROBOTS, "robots", f"are {scenario.population}; a page shows up to {MOST_ROBOTS}"),
        (not all(group.count for group in scenario.robots), "robots.count", "is 0; pages have robots in all groups"),
        (unfit, "robots.controller", commanded),
        (scenario.arena.movables, "arena.movables", "pages have nothing that can be pushed"),
        (scenario.members_change, "robots.present", "all robots of a page are present all the time"),
        (scenario.stop.metric not in ("complex", "reference"), "stop.metric", "pages know complex and reference"),
    )


def robots_facts(scenario: EmbodiedScenario) -> dict[str, Any]:
    """Return the facts from which `web/robots.js` makes swarms; raise ScenarioError for scenarios that have no page."""
    check_robots(scenario)
    arena, contact, stop, groups = scenario.arena.build(), scenario.contact, scenario.stop, scenario.robots
    return {
        "scene": fields_of(SCENE),
        "robot": fields_of(ROBOT),
        "group": fields_of(GROUP),
        "bytes": {"robot": ROBOT.itemsize, "group": GROUP.itemsize},
        "arrays": Swarm._fields,
        "swarms": _swarms(scenario),
        "functions": list(chipmunk.FUNCTIONS),
        "head": chipmunk.FIRST,
        "placements": [each.placement if each.present else "none" for each in groups],
        "memory": [_remembered(each) for each in groups],
        "takes_pictures": [each.signal.kind == "camera" and each.camera.frames_per_s is not None for each in groups],
        "sees": [each.signal.kind for each in groups],
        "infrared": [len(kind.infrared.sensors) if kind.infrared else 0 for kind in scenario.group_kinds],
        "parameters": [fields_of(find_controller(each.controller).parameter_type) for each in groups],
        "memories": [_memory_fields(find_controller(each.controller).memory) for each in groups],
        "cell_cm": cell_cm(scenario.group_kinds),
        "masses": [kind.mass_g for kind in scenario.group_kinds],
        "margin_cm": MARGIN_CM,
        "touch": contact.robots,
        "friction": contact.friction**0.5,
        "wall_cm": WALL_CM,
        "circles": arena.circles.tolist(),
        "polygons": [corners.tolist() for corners in arena.polygons],
        "floor": _floor(arena),
        "lamps": [[x, y, arena.lamp_cm] for x, y, *_ in arena.lamps.tolist()],
        "views": [(view, _view(scenario, view)) for view in _views(scenario)],
        "step_ms": scenario.timing.step_ms,
        "nominal_period_ms": NOMINAL_PERIOD_S * 1000,
        "reference": stop.reference_robot,
        "has_cycles": bool(np.isfinite(Simulation(scenario, seed=0, interpret=True).period_ms[stop.reference_robot])),
        "metric": stop.metric,
        "order_parameter": stop.order_parameter,
        "further_cycles": stop.further_cycles,
        "max_time_s": stop.max_time_s,
        "ranges_cm": [each.camera.range_cm for each in groups],
    }


def _memory_fields(memory: np.dtype[Any]) -> dict[str, tuple[int, str]]:
    """Return offset and kind of each number in a robot's memory; numbers of arrays have names such as `seen.2`."""
    found = {}
    for field, (first, kind) in fields_of(memory).items():
        shape, bytes_each = memory[field].shape, memory[field].base.itemsize
        for place in range(math.prod(shape)):
            found[f"{field}.{place}" if shape else field] = first + place * bytes_each, kind
    return found


def _remembered(group: RobotGroup) -> dict[str, Any]:
    """Return a group's memory at the start, as far as the scenario gives it: a number for all robots, or for each."""
    known, found = _memory_fields(find_controller(group.controller).memory), dict[str, Any]()
    for field, given in group.memory.items():
        names = [name for name in known if name.partition(".")[0] == field]
        columns = np.reshape(given, (group.count, -1)).T.tolist() if np.ndim(given) else [given] * len(names)
        found |= zip(names, columns, strict=True)
    return found


def _floor(arena: Arena) -> list[tuple[float, float, float, float, int]]:
    """Return boxes of one level of grey, 0 to 255: their left, top, right and bottom, as shares of the arena's sides.

    A floor that is white all over has no boxes: pages draw it in a colour of their own.
    """
    if arena.floor.is_white:
        return []
    levels, boxes = floor_levels(arena, PICTURE_CELLS if arena.floor.picture.size else FLOOR_CELLS), []
    rows, columns = levels.shape
    for row, cells in enumerate(levels.tolist()):
        end = 0
        for level, run in groupby(cells):
            first, end = end, end + len(list(run))
            boxes.append((first / columns, 1 - row / rows, end / columns, 1 - (row + 1) / rows, level))
    return boxes


def _swarms(scenario: EmbodiedScenario) -> dict[int, dict[str, Any]]:
    """Return a swarm for each number of robots that finds room: the scenario's alone if they are given one by one."""
    group, found = scenario.robots[0], {}
    is_given = group.poses is not None or any(isinstance(value, list | tuple) for value in group.memory.values())
    is_fixed = is_given or len(scenario.robots) > 1 or scenario.stop.reference_robot > 0
    for count in sorted({group.count, *(() if is_fixed else COUNTS)}):
        with suppress(*[ScenarioError] * (count != group.count)):
            found[count] = _swarm(scenario, count)
    return found


def _swarm(scenario: EmbodiedScenario, count: int) -> dict[str, Any]:
    """Return the start of trials with `count` robots in the first group: a block, and the functions that it calls."""
    changes: dict[str, Any] = {"robots.0.count": count}
    if _has_free_sides(scenario):
        robots, least_cm = count + scenario.population - scenario.robots[0].count, cell_cm(scenario.group_kinds)
        side_cm = max(_sides(scenario), key=lambda side: (math.prod(count_cells(side, side, robots, least_cm)), side))
        changes |= {"arena.width_cm": side_cm, "arena.height_cm": side_cm}
    block, functions = Simulation(with_values(scenario, changes, scenario.name), seed=0, interpret=True).beginning()
    controllers, sensors = own_controllers(scenario), own_sensors(scenario)
    groups = [function for function in functions.values() if isinstance(function, GroupControllers)]

    def name_of(function: Any) -> str:
        if isinstance(function, GroupControllers):
            return controllers.get(groups.index(function), shipped_root(function.controller.name))
        return sensors[function.sensor] if isinstance(function, OwnSensor) else str(function.function.__name__)

    streams = []  # of sensors' robots: their places in the block, and the keys that spawn them from a seed
    for sensor in (function for function in functions.values() if isinstance(function, OwnSensor)):
        first, end = sensor.streams_at
        streams.append({"at": first, "bytes": end - first, "robot": sensor.robots.start, "keys": list(sensor.keys)})
    return {
        "block": base64.b64encode(block.tobytes()).decode(),
        "functions": {index: name_of(function) for index, function in functions.items()},
        "streams": streams,
    }


def _view(scenario: EmbodiedScenario, view_deg: float) -> dict[str, Any]:
    """Return the fields of a camera with another field of view, and the directions of its pixels."""
    section = scenario.robots[0].camera.model_copy(update={"field_of_view_deg": float(view_deg)})
    camera, rays = np.recarray(1, CAMERA), np.recarray(section.pixels, RAY)
    set_camera(camera[0], rays, section, scenario.group_kinds[0], scenario.timing.control_hz)
    numbers = {name: float(camera[0][name]) for name in ("left_rad", "pixels_per_rad", "half_view_rad")}
    return {"camera": numbers, "rays": np.column_stack([rays.cos, rays.sin]).ravel().tolist()}


def _has_free_sides(scenario: EmbodiedScenario) -> bool:
    """Return whether a page may change the arena's size: it is square, and nothing has a fixed place in it."""
    arena = scenario.arena
    is_empty = not (arena.obstacles or arena.movables or arena.lamps or arena.floor.patches or arena.floor.picture)
    return is_empty and arena.width_cm == arena.height_cm and all(group.poses is None for group in scenario.robots)


def _sides(scenario: EmbodiedScenario) -> tuple[float, ...]:
    return stops(30, 200, step=10, also=[scenario.arena.width_cm])


def _views(scenario: EmbodiedScenario) -> tuple[Any, ...]:
    return tuple(sorted({*VIEWS_DEG, scenario.robots[0].camera.field_of_view_deg}))


def robots_settings(scenario: EmbodiedScenario, thesis: EmbodiedScenario, counts: tuple[int, ...]) -> list[Setting]:
    """Return the settings of a page of robots; thesis: the base case; counts: numbers of robots that the page has."""
    group, base, side_cm = scenario.robots[0], thesis.robots[0], scenario.arena.width_cm
    settings, whose = [], " of the first group" * (len(scenario.robots) > 1)
    if len(counts) > 1:
        settings.append(Setting("robots.0.count", "robots", "", counts, group.count, base.count))
    for name, (label, unit, found) in PARAMETERS.items():
        own, of_base = group.parameters.get(name), base.parameters.get(name)
        if isinstance(own, float):
            key, known = f"robots.0.parameters.{name}", found if of_base is None else (*found, of_base)
            most = scenario.group_kinds[0].wheel_limit_cm_s if name == "speed_cm_s" else math.inf
            fitting = allowed(scenario, key, sorted({own, *(value for value in known if value <= most)}))
            settings.append(Setting(key, label + whose, unit, fitting, own, of_base))
    if group.signal.kind == "camera":
        view, of_base = group.camera.field_of_view_deg, base.camera.field_of_view_deg
        key = "robots.0.camera.field_of_view_deg"
        settings.append(Setting(key, f"field of view{whose}", "°", _views(scenario), view, of_base))
    if _has_free_sides(scenario):
        sides = _sides(scenario)
        settings.append(Setting("arena.width_cm", "side of the arena", "cm", sides, side_cm, thesis.arena.width_cm))
    return settings
