"""Claims about radio pulses: who receives which, when, and what is lost."""

from typing import Any

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation

SENDER = """
PARAMETERS = {"first": 3, "every": 1000, "message": 0}
MEMORY = {"steps": int, "pulses": int, "heard": (int, 8), "total": int}

def start(memory, parameters, random):
    memory.steps = 0

def step(sensors, memory, actuators, parameters, random):
    due = memory.steps >= parameters.first and (memory.steps - parameters.first) % parameters.every == 0
    actuators.ring_on = due and parameters.message == 0
    actuators.send = parameters.message if due else 0
    memory.pulses = sensors.pulses
    memory.total += sensors.pulses
    for place in range(8):
        memory.heard[place] = sensors.messages[place]
    memory.steps += 1
"""
NEVER = 10**6


@pytest.fixture
def swarm(tmp_path):
    """Return a function that makes groups of one robot each, on a line 20 cm apart."""
    (tmp_path / "sender.py").write_text(SENDER)

    def make(*parameters: dict[str, Any], interpret: bool = False, seed: int = 1, **signal: Any) -> Simulation:
        groups = [
            {
                "poses": [[10 + 20 * place, 20, 0]],
                "controller": str(tmp_path / "sender.py"),
                "parameters": given,
                "signal": {"kind": "radio", **signal},
            }
            for place, given in enumerate(parameters)
        ]
        arena = {"width_cm": 20 * len(parameters) + 20, "height_cm": 40}
        return Simulation({"arena": arena, "robots": groups}, seed, interpret=interpret)

    return make


def pulses(simulation: Simulation, steps: int) -> list[list[int]]:
    """Return for each step how many pulses each robot's controller has heard."""
    return [[int(memory["pulses"][0]) for memory in simulation.advance(1).memories] for _ in range(steps)]


LISTEN = {"first": NEVER}


@pytest.mark.parametrize("interpret", [False, True])
@pytest.mark.parametrize(("latency_ms", "late"), [(0, 1), (1, 2), (100, 2), (250, 4)])
def test_a_pulse_arrives_once_in_the_step_after_it_was_sent_or_later_by_the_latency(swarm, latency_ms, late, interpret):
    heard = pulses(swarm({}, LISTEN, latency_ms=latency_ms, interpret=interpret), 10)
    assert [step for step, (_, listener) in enumerate(heard) if listener] == [3 + late]
    assert not any(sender for sender, _ in heard)


def test_a_message_arrives_with_its_pulse_and_a_flash_without_one(swarm):
    simulation = swarm({"message": 77}, {}, LISTEN)
    simulation.advance(4)
    step = simulation.advance(1)
    heard = step.memories[2]
    assert heard["pulses"][0] == 2
    assert heard["heard"][0].tolist() == [77, 0, 0, 0, 0, 0, 0, 0]
    assert step.camera[:, 0].tolist() == [1, 1, 1]
    assert simulation.advance(1).memories[2]["heard"][0].tolist() == [0] * 8


def test_pulses_pass_through_bodies_and_end_at_the_range(swarm):
    assert pulses(swarm({}, LISTEN, LISTEN, LISTEN, range_cm=40), 5)[4] == [0, 1, 1, 0]


def test_a_cone_of_emission_sends_ahead_only(swarm):
    assert pulses(swarm(LISTEN, {}, LISTEN, angle_deg=90, of="emission"), 5)[4] == [0, 0, 1]
    assert pulses(swarm(LISTEN, {}, LISTEN, angle_deg=90), 5)[4] == [1, 0, 0]


@pytest.mark.parametrize(("collisions", "heard"), [(False, [1, 1, 2]), (True, [1, 1, 0])])
def test_pulses_that_collide_are_received_by_nobody_who_hears_both(swarm, collisions, heard):
    assert pulses(swarm({}, {}, LISTEN, collisions=collisions), 5)[4] == heard


@pytest.mark.parametrize(("half_duplex", "heard"), [(False, [1, 1, 2]), (True, [0, 0, 2])])
def test_who_sends_is_deaf_with_half_duplex(swarm, half_duplex, heard):
    assert pulses(swarm({}, {}, LISTEN, half_duplex=half_duplex), 5)[4] == heard


def test_pulses_are_lost_one_by_one_with_the_given_probability(swarm):
    steps = 4000
    step = swarm({"every": 2}, LISTEN, LISTEN, loss=0.3).advance(steps)
    sent = (steps - 4 + 1) // 2
    totals = np.array([int(memory["total"][0]) for memory in step.memories])
    assert totals[0] == 0
    assert (np.abs(totals[1:] - 0.7 * sent) < 4 * np.sqrt(0.21 * sent)).all()
    assert totals[1] != totals[2]


def test_nothing_is_lost_or_everything_at_the_ends(swarm):
    assert pulses(swarm({}, LISTEN, loss=0), 5)[4] == [0, 1]
    assert pulses(swarm({}, LISTEN, loss=1), 5)[4] == [0, 0]
