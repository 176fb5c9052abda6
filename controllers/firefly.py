"""The robot of thesis chapter 4: it flashes as `oscillator` does and moves as `obstacle_avoidance` does."""

import obstacle_avoidance
import oscillator

PARAMETERS = obstacle_avoidance.PARAMETERS | oscillator.PARAMETERS
MEMORY = obstacle_avoidance.MEMORY | oscillator.MEMORY


def check(parameters):
    """Refuse what either part refuses."""
    obstacle_avoidance.check(parameters)
    oscillator.check(parameters)


def start(memory, parameters, random):
    """Start both parts."""
    obstacle_avoidance.start(memory, parameters, random)
    oscillator.start(memory, parameters, random)


def step(sensors, memory, actuators, parameters, random):
    """Run both parts; motion and synchronisation do not affect each other (thesis Appendix B)."""
    obstacle_avoidance.step(sensors, memory, actuators, parameters, random)
    oscillator.step(sensors, memory, actuators, parameters, random)
