"""Small blocks of robots with controllers, but without bodies and sensors."""

import numpy as np

from epuck_sim.embodied.controllers import GroupControllers, assign_bytes, bytes_needed
from epuck_sim.embodied.swarm import make_block, open_block


def controlled_block(controllers, counts, *, interpret=True):
    """Return a block with groups of robots in the arena, and their controllers, which have started.

    Args:
        controllers: Controller of each group, with its default parameters.
        counts: Number of robots of each group.
        interpret: Whether controllers run as plain Python.
    """
    sizes = [bytes_needed(*group) for group in zip(controllers, counts, strict=True)]
    robots, groups = sum(counts), len(counts)
    rooms = {"cells": 99, "members": robots, "circles": 9, "numbers": 2 * robots, "pixels": 3 * robots}
    block = make_block({"robots": robots, "groups": groups, **rooms, "bytes": sum(sizes)})
    swarm = open_block(block)
    swarm.groups.count, swarm.groups.pixels = counts, 1
    swarm.groups.first = swarm.groups.row = np.cumsum([0, *counts])[:-1]
    swarm.groups.in_view, swarm.groups.waiting = swarm.groups.row + robots, swarm.groups.row + 2 * robots
    swarm.robots.present, swarm.robots.random = True, 1 + np.arange(4 * robots).reshape(-1, 4)
    swarm.scene[0].step, swarm.scene[0].step_ms = -1, 100
    runs = []
    for number, controller in enumerate(controllers):
        assign_bytes(swarm, number, controller, sum(sizes[:number]))
        run = GroupControllers(block, swarm, number, controller, interpret=interpret)
        run.parameters[:] = controller.parameter_record(controller.parameters)
        run.start()
        runs.append(run)
    return block, runs
