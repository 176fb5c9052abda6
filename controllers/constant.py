"""Fixed wheel speeds, and the ring on or off: for scenes and tests."""

PARAMETERS = {"left_cm_s": 0.0, "right_cm_s": 0.0, "ring_on": False}

MEMORY = {}


def check(parameters):
    """Refuse speeds beyond the wheels' limit."""
    for name in ("left_cm_s", "right_cm_s"):
        speed = getattr(parameters, name)
        if not -12.8 <= speed <= 12.8:
            raise ValueError(f"{name} is {speed}; allowed: -12.8 to 12.8, the wheels' limit")


def start(memory, parameters, random):
    """Do nothing: there is nothing to remember."""


def step(sensors, memory, actuators, parameters, random):
    """Set the same command in each step."""
    actuators.left_cm_s = parameters.left_cm_s
    actuators.right_cm_s = parameters.right_cm_s
    actuators.ring_on = parameters.ring_on
