"""Small swarms of robots with controllers, but without bodies and sensors."""

from tests.control.bench import controlled_swarm


def started_swarm(controllers, counts):
    """Return a block with groups of robots in the arena, the swarm, and controllers, which have started."""
    robots = sum(counts)
    rooms = {"cells": 99, "members": robots, "circles": 9, "numbers": 2 * robots}
    block, swarm, runs = controlled_swarm(controllers, counts, 3, seed=1, **rooms)
    swarm.groups.pixels, swarm.groups.row = 1, swarm.groups.first
    swarm.groups.in_view, swarm.groups.waiting = swarm.groups.row + robots, swarm.groups.row + 2 * robots
    swarm.scene[0].step, swarm.scene[0].step_ms = -1, 100
    for run in runs:
        run.start()
    return block, swarm, runs
