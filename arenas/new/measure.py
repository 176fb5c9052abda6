"""A measure of trials; run it with: epuck-sim run thesis --measure NAME.py

It runs as it stands: the path length of the swarm's centre, in cm, from cycle to cycle. Change what you need.
"""

import numpy as np


class NAME:
    """Path length of the swarm's centre in cm."""

    # The simulation is a `Simulation` of robots or a `ParticleSimulation`, before its first event.
    # Arguments after the star are parameters, with defaults; a scenario sets them as {NAME.py: {from_cycle: 3}}.
    def __init__(self, simulation, *, from_cycle=1):
        self.simulation = simulation
        self.from_cycle = from_cycle
        self.centre = None
        self.length_cm = 0.0

    # Called after every firing of the reference; it costs nothing in between.
    # For every control step of robots, add `def step(self, step, state)`; for every event of point agents,
    # `def event(self, event, state)`. Leave out what you do not need: `step` and `event` make trials slower.
    # `state` has time_s, cycles, order_parameter and is_synchronised.
    def cycle(self, event, state):
        if state.cycles < self.from_cycle:
            return
        centre = self.positions(event).mean(axis=0)
        if self.centre is not None:
            self.length_cm += float(np.linalg.norm(centre - self.centre))
        self.centre = centre

    # Called at the end: return a number, True or False, None if it is undetermined, or a list with one of these
    # for each cycle.
    def value(self):
        return self.length_cm

    def positions(self, event):
        if hasattr(event, "poses"):  # a step of robots
            return event.poses[:, :2]
        return self.simulation.positions()  # of point agents
