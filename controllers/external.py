"""Wheels and ring as commanded from outside, by `Simulation.command`: for policies, games and other programs."""

PARAMETERS = {}

MEMORY = {}

EXTERNAL = ("wheels", "ring")


def start(memory, parameters, random):
    """Do nothing: there is nothing to remember."""


def step(sensors, memory, actuators, parameters, random):
    """Do nothing: actuators keep what was commanded."""
