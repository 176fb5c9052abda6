"""Random walks: straight runs of random duration, at whose ends agents turn and may change speed (thesis 6.2)."""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, StreamArray
from epuck_sim.particles.distributions import speed_table
from epuck_sim.scenario.agents import AgentsSection
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.rng import uniform

LONGEST_RUN = 1e12
"""Cycles: upper limit of a run; no trial lasts as long, and times as long as this still have digits to spare."""


class Walk(NamedTuple):
    """The rule by which runs end, and when the present run of each agent does."""

    is_straight: bool
    """Whether there are no runs: agents go straight ahead from wall to wall."""
    run: float
    """Cycles: mean duration of a run, or the shortest if durations follow a power law."""
    tail: float
    """Power of a uniform number that is a duration in units of the shortest, below 0; 0 if they are exponential."""
    persistence: float
    """Mean cosine of the turns, 0 to 1."""
    speeds: FloatArray
    """(speeds,) cm per cycle: what each run's speed is drawn from; empty if agents keep their speeds."""
    end_cycle: FloatArray
    """(agents,) the cycle in which each run ends; empty if there are no runs."""
    end_time: FloatArray
    """(agents,) the time in that cycle, 0 to 1."""


def make_walk(agents: AgentsSection, period_s: float) -> Walk:
    """Return the walk of some agents, before their first runs."""
    walk = agents.walk
    count = 0 if walk.kind == "straight" else agents.count
    end_cycle, end_time = np.zeros((2, count))
    return Walk(
        walk.kind == "straight",
        (walk.run_s or 0.0) / period_s,
        0.0 if walk.exponent is None else 1 / (1 - walk.exponent),
        walk.persistence or 0.0,
        speed_table(agents) * period_s if agents.speed_per_run else np.zeros(0),
        end_cycle,
        end_time,
    )


@jit_inline
def begin_run(walk: Walk, agent: int, cycle: float, time: float, stream: StreamArray) -> None:
    """Draw when a run ends that an agent begins at `time` of `cycle`."""
    share = 1.0 - uniform(stream)  # above 0
    duration = walk.run * (share**walk.tail if walk.tail < 0 else -math.log(share))
    end = time + min(duration, LONGEST_RUN)
    whole = math.floor(end)
    walk.end_cycle[agent] = cycle + whole
    walk.end_time[agent] = end - whole


@jit_inline
def rest_of_run(walk: Walk, agent: int, cycle: float, time: float) -> float:
    """Return how many cycles of an agent's run are left at `time` of `cycle`."""
    rest: float = (walk.end_cycle[agent] - cycle) + (walk.end_time[agent] - time)
    return rest
