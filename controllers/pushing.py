"""A robot that pushes at its flashes: it flashes as `oscillator` does, and drives straight ahead while lit."""

import oscillator

PARAMETERS = {"speed_cm_s": 2.0} | oscillator.PARAMETERS  # the speed while the ring is lit
MEMORY = oscillator.MEMORY


def check(parameters):
    """Refuse speeds beyond the wheels' limit, and what the oscillator refuses."""
    if not 0 <= parameters.speed_cm_s <= 12.8:
        raise ValueError(f"speed_cm_s is {parameters.speed_cm_s}; allowed: 0 to 12.8, the wheels' limit")
    oscillator.check(parameters)


def start(memory, parameters, random):
    """Start the oscillator."""
    oscillator.start(memory, parameters, random)


def step(sensors, memory, actuators, parameters, random):
    """Run the oscillator; push while the ring is lit."""
    oscillator.step(sensors, memory, actuators, parameters, random)
    speed = parameters.speed_cm_s if actuators.ring_on else 0.0
    actuators.left_cm_s = speed
    actuators.right_cm_s = speed
