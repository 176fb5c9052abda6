"""Scenes for tests of controllers: one robot in front of something, in the simulator, without noise."""

import math
from pathlib import Path

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.epuck import RADIUS_CM
from epuck_sim.user_files import Value

SIDE_CM = 100.0  # side of the arena


def facing_wall(
    controller: str | Path, gap_cm: float = 5.0, *, seed: int = 0, interpret: bool = True, **parameters: Value
) -> Simulation:
    """Return a simulation of robot 0 that looks at a wall.

    Args:
        controller: A shipped controller's name, or a file, relative to the working directory.
        gap_cm: Distance between its body and the wall, above 0.
        seed: Seed of the trial.
        interpret: Whether the controller runs as plain Python.
        parameters: The controller's parameters.

    >>> facing_wall("obstacle_avoidance", gap_cm=1).advance(2).wheels_cm_s[0]
    array([ 12.8, -12.8])
    """
    pose = (SIDE_CM - RADIUS_CM - gap_cm, SIDE_CM / 2, 0.0)
    return _simulation([_group(controller, pose, parameters)], seed, interpret=interpret)


def facing_robot(
    controller: str | Path,
    gap_cm: float = 20.0,
    *,
    lit: bool = True,
    seed: int = 0,
    interpret: bool = True,
    **parameters: Value,
) -> Simulation:
    """Return a simulation of robot 0 that looks at robot 1, which stands still.

    Args:
        controller: A shipped controller's name, or a file, relative to the working directory.
        gap_cm: Distance between their bodies, above 0.
        lit: Whether the ring of robot 1 is lit; robot 0 sees it from the second step on.
        seed: Seed of the trial.
        interpret: Whether controllers run as plain Python.
        parameters: The parameters of robot 0's controller.

    >>> int(facing_robot("oscillator", gap_cm=10).advance(2).camera[0].sum()) > 10
    True
    """
    middle, apart = SIDE_CM / 2, gap_cm + 2 * RADIUS_CM
    other = _group("constant", (middle + apart / 2, middle, math.pi), {"ring_on": lit})
    return _simulation(
        [_group(controller, (middle - apart / 2, middle, 0.0), parameters), other], seed, interpret=interpret
    )


def _group(controller: str | Path, pose: tuple[float, float, float], parameters: dict[str, Value]) -> dict[str, object]:
    return {"controller": str(controller), "poses": [pose], "parameters": parameters}


def _simulation(groups: list[dict[str, object]], seed: int, *, interpret: bool) -> Simulation:
    arena = {"width_cm": SIDE_CM, "height_cm": SIDE_CM}
    return Simulation({"name": "scene", "arena": arena, "noise": "off", "robots": groups}, seed, interpret=interpret)
