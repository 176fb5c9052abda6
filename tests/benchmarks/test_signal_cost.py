"""What signals cost in a control step, beside the camera. Run by `make bench`.

Flashes hardly move phases, so that in all swarms the same rings are lit, one in thirteen at a time. What a signal
costs is a step's time without that of the same swarm whose rings stay dark.
"""

import time
from typing import Any

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation

pytestmark = pytest.mark.benchmark

SWARMS = {10: 60, 100: 200, 1000: 700}
"""Robots, and the side of their arena in cm."""

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

BLOCK = 50
"""Steps in a turn: a period of the rings."""


@pytest.fixture(scope="module")
def costs():
    """(signal, robots) -> us of a signal in a step, and it and a whole step relative to the camera's; printed."""
    found: dict[tuple[str, int], tuple[float, float, float]] = {}
    yield found
    print(
        "\n\nCPU time of a signal in a step in us, relative to the camera's, and that of a whole step relative to its"
    )
    print("signal                       robots       us   signal     step")
    for (signal, robots), (us, ratio, step_ratio) in found.items():
        print(f"{signal:28} {robots:6}  {us:7.1f}  {ratio:7.2f}  {step_ratio:7.2f}")


def swarm(robots: int, signal: dict[str, Any], parameters: dict[str, float]) -> Simulation:
    """Return a swarm whose phases flashes hardly move."""
    side_cm = SWARMS[robots]
    group = {"count": robots, "signal": signal, "parameters": parameters}
    return Simulation({"arena": {"width_cm": side_cm, "height_cm": side_cm}, "robots": [group]}, 1)


@pytest.mark.parametrize("robots", SWARMS)
def test_what_signals_cost(benchmark, costs, robots: int) -> None:
    simulations = {name: swarm(robots, signal, OSCILLATING) for name, signal in SIGNALS.items()}
    simulations[DARK] = swarm(robots, SIGNALS[CAMERA], STAYING_DARK)
    spent_us: dict[str, list[float]] = {name: [] for name in simulations}

    def take_turns() -> None:
        for name, simulation in simulations.items():
            began = time.thread_time()
            simulation.advance(BLOCK)
            spent_us[name].append((time.thread_time() - began) / BLOCK * 1e6)

    benchmark.pedantic(take_turns, rounds=max(15, 3000 // robots), warmup_rounds=1)
    found = {name: np.array(spent[1:]) for name, spent in spent_us.items()}
    own = {name: np.median(found[name] - found[DARK]) for name in SIGNALS}
    for name in SIGNALS:
        costs[name, robots] = own[name], own[name] / own[CAMERA], np.median(found[name] / found[CAMERA])
