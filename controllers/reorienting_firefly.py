"""The robot of thesis chapter 3: it flashes as `oscillator` does and moves as `reorientation` does."""

import oscillator
import reorientation

PARAMETERS = reorientation.PARAMETERS | oscillator.PARAMETERS
MEMORY = reorientation.MEMORY | oscillator.MEMORY


def check(parameters):
    """Refuse what either part refuses."""
    reorientation.check(parameters)
    oscillator.check(parameters)


def start(memory, parameters, random):
    """Start both parts."""
    reorientation.start(memory, parameters, random)
    oscillator.start(memory, parameters, random)


def step(sensors, memory, actuators, parameters, random):
    """Run both parts; motion and synchronisation do not affect each other."""
    reorientation.step(sensors, memory, actuators, parameters, random)
    oscillator.step(sensors, memory, actuators, parameters, random)
