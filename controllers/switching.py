"""A firefly that is fast until it flashes together with others, and slow from then on (thesis 6.2).

Only its camera decides. A flash that begins within the robot's own refractory period comes together with its own. After
enough of these in a row, it takes the others for synchronised; after a flash at any other time, it is fast again.
"""

import firefly

PARAMETERS = firefly.PARAMETERS | {
    "slow_cm_s": 1.0,  # speed ahead of a robot that takes the others for synchronised
    "flashes_to_settle": 5,  # flashes in a row, in its refractory period, after which it does
}
MEMORY = firefly.MEMORY | {"flashes_in_window": int}


def check(parameters):
    """Refuse what a firefly refuses, and speeds and counts that make no sense."""
    firefly.check(parameters)
    if not 0 <= parameters.slow_cm_s <= 12.8:
        raise ValueError(f"slow_cm_s is {parameters.slow_cm_s}; allowed: 0 to 12.8, the wheels' limit")
    if parameters.flashes_to_settle < 1:
        raise ValueError(f"flashes_to_settle is {parameters.flashes_to_settle}; allowed: 1 and above")


def start(memory, parameters, random):
    """Start as a firefly that has seen no flash."""
    firefly.start(memory, parameters, random)
    memory.flashes_in_window = 0


def step(sensors, memory, actuators, parameters, random):
    """Run a firefly, and slow it down where it goes straight ahead."""
    was_seen = memory.flash_seen
    window_ms = parameters.refractory_fraction * parameters.period_s * 1000
    firefly.step(sensors, memory, actuators, parameters, random)
    if memory.flash_seen and not was_seen:
        memory.flashes_in_window = memory.flashes_in_window + 1 if memory.phase_ms <= window_ms else 0
    is_settled = memory.flashes_in_window >= parameters.flashes_to_settle
    if is_settled and memory.rotation_time == 0 and actuators.left_cm_s == actuators.right_cm_s:
        actuators.left_cm_s = parameters.slow_cm_s
        actuators.right_cm_s = parameters.slow_cm_s
