"""Steps that are kept or made up, and scenarios in which much changes while a trial runs."""

from collections.abc import Sequence
from itertools import islice

import numpy as np

from epuck_sim import Simulation, Step
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.swarm import open_block
from epuck_sim.faults import KINDS


def bare_step(number: int, time_s: float, ring_on: BoolArray, phase_ms: Sequence[float] | FloatArray) -> Step:
    """Return a step in which rings are lit and oscillators have phases, and nothing else is known."""
    memory = np.array([(phase,) for phase in phase_ms], [("phase_ms", float)])
    seen = (np.empty((0, 2)), np.ones(len(ring_on), bool), None, (memory,), (), None, {})
    return Step(number, time_s, *[np.empty(0)] * 5, ring_on, ring_on, *seen)


def constant(poses, speed_cm_s=0.0, **parameters):
    parameters = {"left_cm_s": speed_cm_s, "right_cm_s": speed_cm_s, **parameters}
    return {"poses": poses, "controller": "constant", "parameters": parameters}


def kept(simulation, count):
    """Return the next `count` steps with arrays of their own."""
    steps = []
    for step in islice(simulation, count):
        arrays = {name: value.copy() for name, value in step._asdict().items() if isinstance(value, np.ndarray)}
        steps.append(step._replace(**arrays, memories=tuple(memory.copy() for memory in step.memories)))
    return steps


def bits(step):
    arrays = [np.array([step.number, step.time_s]), *(each for each in step if isinstance(each, np.ndarray))]
    return [(each.shape, each.dtype.str, each.tobytes()) for each in (*arrays, *step.memories)]


SHOWN = ("poses", "ring_on", "ring_commands", "camera", "infrared", "distance_mm", "phase_ms")
NOWHERE = np.zeros(0, np.int64)  # for kernels that call nothing


def swarm_of(simulation):
    return open_block(simulation._block)


def steps_of(scenario, steps, seed=3):
    taken = kept(Simulation(scenario, seed), steps)
    return {name: np.array([getattr(step, name) for step in taken]) for name in SHOWN}


EVERYTHING = [
    *({"kind": kind, "count": 2, "per_hour": 900, "mean_s": 4} for kind in list(KINDS)[:3]),
    {"kind": "clock_drift", "rate": 1.03, "share": 0.5, "at_s": 3, "until_s": 12},
    {"kind": "clock_jitter", "jitter": 0.05, "share": 0.3, "at_s": 1},
    {"kind": "camera_blind", "count": 2, "per_hour": 900, "mean_s": 4},
    {"kind": "camera_misses", "missed": 0.4, "share": 0.7},
    {"kind": "camera_misses", "missed": 1, "farther_than_cm": 20, "robots": [1]},
    {"kind": "infrared_dead", "count": 2, "per_hour": 900, "mean_s": 4},
    {"kind": "wheels_dead", "count": 2, "per_hour": 900, "mean_s": 4},
    {"kind": "restart", "per_hour": 300},
]
SLOW_CAMERA = {"frames_per_s": 8, "latency_ms": 50}
ANGULAR = {"kind": "cone", "angle_deg": 90}
FAULTY = {"faults": EVERYTHING, "robots": [{"count": 4, "camera": SLOW_CAMERA}, {"count": 4, "signal": ANGULAR}]}

ONE_AND_TWO = [{"poses": [[15, 15, 0]]}, {"poses": [[15, 30, 0], [15, 45, 0]]}]
APART = {"robots": ONE_AND_TWO, "noise": "off", "arena": {"width_cm": 100}}
SCHEDULED = {
    **APART,
    "faults": [{"kind": "ring_dead", "robots": [1], "scheduled": True}],
    "schedule": [
        {"at_s": 1.0, "set": {"robots.1.parameters.speed_cm_s": 1.5, "robots.1.parameters.coupling": 0.3}},
        {"at_s": 2.35, "displace": {"robots": [0, 2], "by_cycles": 0.25}},
        {"at_s": 0.5, "begin": [0]},
        {"at_s": 1.5, "end": [0]},
        {"at_s": 3.0, "displace": {"by_cycles": "random"}, "set": {"robots.0.parameters.speed_cm_s": 0}},
    ],
}

GATE = [{"shape": "box", "x_cm": 30, "y_cm": 30, "width_cm": 2, "height_cm": 60}]
PILLARS = [
    {"shape": "circle", "x_cm": 45, "y_cm": 20, "radius_cm": 4},
    {"shape": "polygon", "corners_cm": [[40, 40], [50, 40], [45, 48]]},
]
MOVABLES = [{"x_cm": 20, "y_cm": 25, "radius_cm": 3, "mass_kg": 0.05, "friction": 0.1}]
REBUILT = {
    "arena": {"obstacles": GATE, "movables": MOVABLES},
    "robots": [{"poses": [[10, 10, 0], [10, 25, 0.5], [10, 40, -0.5]]}, {"poses": [[20, 50, 0]]}],
    "schedule": [
        {"at_s": 3, "set": {"arena.obstacles": PILLARS, "arena.width_cm": 65, "arena.height_cm": 60}},
        {"at_s": 5, "set": {"arena.width_cm": 90, "arena.height_cm": 70, "arena.obstacles": []}},
    ],
}

SIGNALS = [
    {"kind": "camera"},
    {"kind": "cone", "angle_deg": 360, "range_cm": 30},
    {"kind": "enki_camera", "angle_deg": 300},
    {"kind": "radio", "collisions": True},
]


def coming_and_going(signal):
    """Return a scenario in which robots that sense each other by this signal come and go."""
    first = {"count": 6, "signal": signal, "placement": "grid"}
    if signal["kind"] == "camera":
        first["camera"] = SLOW_CAMERA
    return {
        "robots": [first, {"count": 3, "present": False, "signal": signal, "placement": "grid"}],
        "schedule": [
            {"at_s": 1, "remove": [2, 4], "add": [6]},
            {"at_s": 2.5, "add": [7, 2], "remove": [0, 6, 7]},
            {"at_s": 4, "add": [0, 1, 8]},
        ],
        "arena": {"width_cm": 150, "height_cm": 150, "obstacles": []},
        "stop": {"reference_robot": 3},
        "faults": [{"kind": "restart", "per_hour": 900}],
    }


CHANGING = {  # scenarios in which something changes within six seconds
    "faulty": FAULTY,
    "scheduled": SCHEDULED,
    "rebuilt": REBUILT,
    "among movables": {
        "robots": [{"poses": [[10, 10, 0.3], [20, 15, 2], [30, 12, 3], [45, 45, 1]]}],
        "noise": "off",
        "arena": {"movables": MOVABLES},
        "schedule": [{"at_s": 2, "remove": [1, 2]}, {"at_s": 4, "add": [1], "set": {"arena.width_cm": 61}}],
    },
    **{f"by signal {number}": coming_and_going(signal) for number, signal in enumerate(SIGNALS)},
}
