"""A firefly that wanders: it flashes as `oscillator` does and moves as `random_walk` does (thesis 6.2)."""

import oscillator
import random_walk

PARAMETERS = random_walk.PARAMETERS | oscillator.PARAMETERS
MEMORY = random_walk.MEMORY | oscillator.MEMORY


def check(parameters):
    """Refuse what either part refuses."""
    random_walk.check(parameters)
    oscillator.check(parameters)


def start(memory, parameters, random):
    """Start both parts."""
    random_walk.start(memory, parameters, random)
    oscillator.start(memory, parameters, random)


def step(sensors, memory, actuators, parameters, random):
    """Run both parts; motion and synchronisation do not affect each other."""
    random_walk.step(sensors, memory, actuators, parameters, random)
    oscillator.step(sensors, memory, actuators, parameters, random)
