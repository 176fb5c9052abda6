"""A robot that turns on the spot, sends its count of pulses by radio now and then, and flashes where it hears 3."""

from epuck_sim.util.rng import randint, uniform

PARAMETERS = {"every_steps": 7, "turn_rad": 0.3}

MEMORY = {"steps": int, "heard": int, "words": (int, 8)}


def start(memory, parameters, random):
    """Begin anywhere between two messages."""
    memory.steps = randint(random, parameters.every_steps)


def step(sensors, memory, actuators, parameters, random):
    """Count what is heard, and tell the others now and then."""
    memory.heard += sensors.pulses
    for place in range(8):
        memory.words[place] = sensors.messages[place]
    actuators.send = memory.heard % 5 + 1 if memory.steps % parameters.every_steps == 0 else 0
    actuators.ring_on = sensors.messages[0] == 3
    actuators.turn_rad = parameters.turn_rad * (uniform(random) - 0.5)
    actuators.left_cm_s = 4.0
    actuators.right_cm_s = 4.0
    memory.steps += 1
