"""What signals cost in a control step, beside the camera. Run by `make bench`.

Flashes hardly move phases, so that in all swarms the same rings are lit, one in thirteen at a time. What a signal
costs is a step's time without that of the same swarm whose rings stay dark.
"""

from functools import partial
from typing import Any

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation
from tests.benchmarks.measuring import take_turns

SWARMS = {10: 60, 100: 200, 1000: 700}  # robots, and the side of their arena in cm

CAMERA, DARK = "camera", "dark"

SIGNALS: dict[str, dict[str, Any]] = {
    CAMERA: {"kind": "camera"},
    "cone, no occlusion": {"kind": "cone", "occlusion": False},
    "cone": {"kind": "cone"},
    "cone of 50 cm, 60 degrees": {"kind": "cone", "range_cm": 50, "angle_deg": 60},
    "Enki's camera": {"kind": "enki_camera"},
    "Enki's camera, 50 cm, 60 deg": {"kind": "enki_camera", "range_cm": 50, "angle_deg": 60},
    "radio": {"kind": "radio"},
    "radio, collisions": {"kind": "radio", "collisions": True},
}
"""Sections `signal`; cones and radios of unlimited range, all around, unless another is named."""

OSCILLATING = {"coupling": 1e-6}
STAYING_DARK = OSCILLATING | {"period_s": 86_400.0, "flash_fraction": 1e-6}
"""Parameters of controllers; nearly no ring is ever lit in a trial as short as these."""

BLOCK = 50  # steps in a turn: a period of the rings


COLUMNS = "signal", "robots", "us a step", "over the camera's", "a whole step over its"


def swarm(robots: int, signal: dict[str, Any], parameters: dict[str, float]) -> Simulation:
    """Return a swarm whose phases flashes hardly move."""
    side_cm = SWARMS[robots]
    group = {"count": robots, "signal": signal, "parameters": parameters}
    return Simulation({"arena": {"width_cm": side_cm, "height_cm": side_cm}, "robots": [group]}, 1)


@pytest.mark.parametrize("robots", SWARMS)
def test_what_signals_cost(show, robots: int) -> None:
    simulations = {name: swarm(robots, signal, OSCILLATING) for name, signal in SIGNALS.items()}
    simulations[DARK] = swarm(robots, SIGNALS[CAMERA], STAYING_DARK)
    works = {name: partial(simulation.advance, BLOCK) for name, simulation in simulations.items()}
    found = take_turns(works, max(15, 3000 // robots))
    own_us = {name: np.median(found[name] - found[DARK]) / BLOCK for name in SIGNALS}
    for name in SIGNALS:
        ratios = own_us[name] / own_us[CAMERA], np.median(found[name] / found[CAMERA])
        show(COLUMNS, name, robots, own_us[name], *ratios)
