"""The command `new`: writes a commented file to begin with."""

import keyword
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first

news = typer.Typer(no_args_is_help=True, help="Write a commented file to begin with.")

MEASURE = '''\
"""A measure of trials; run it with: epuck-sim run thesis --measure {name}.py

It runs as it stands: the path length of the swarm's centre, in cm, from cycle to cycle. Change what you need.
"""

import numpy as np


class {name}:
    """Path length of the swarm's centre in cm."""

    # The simulation is a `Simulation` of robots or a `ParticleSimulation`, before its first event.
    # What follows the star are parameters, with defaults; a scenario sets them as {{{name}.py: {{from_cycle: 3}}}}.
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
        self.centre = centre  # arrays of robots are overwritten in the next step: keep copies; a mean is one

    # Called at the end: return a number, True or False, None where it is undetermined, or a list with one of these
    # for each cycle.
    def value(self):
        return self.length_cm

    def positions(self, event):
        if hasattr(event, "poses"):  # a step of robots
            return event.poses[:, :2]
        return self.simulation.positions()  # of point agents
'''
"""Text of a new measure; {name} is its name."""


@news.command("measure")
def new_measure(name: Annotated[str, typer.Argument(help="Name of the measure, and of its file NAME.py.")]) -> None:
    """Write NAME.py, a commented measure of trials that runs as it stands."""
    with exit_on_error():
        path = Path(f"{name}.py")
        is_name = name.isidentifier() and not keyword.iskeyword(name) and not name.startswith("_")
        reject_first(
            (not is_name, f"{name!r} is no name for a measure; allowed: letters, digits and _, such as coverage"),
            (path.exists(), f"{path}: exists already; give another name"),
        )
        path.write_text(MEASURE.format(name=name), encoding="utf-8")
        typer.echo(f"{path}: try it: epuck-sim run thesis --measure {path}")
