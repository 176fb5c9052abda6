"""Claims about radio pulses: who receives which, when, and what is lost."""

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation
from tests.control.bench import with_step

SENDER = with_step(
    """due = memory.steps >= parameters.first and (memory.steps - parameters.first) % parameters.every == 0
    actuators.ring_on = due and parameters.message == 0
    actuators.send = parameters.message if due else 0
    memory.pulses = sensors.pulses
    memory.total += sensors.pulses
    memory.heard[:] = sensors.messages
    memory.steps += 1""",
    PARAMETERS="{'first': 3, 'every': 1000, 'message': 0}",
    MEMORY="{'steps': int, 'pulses': int, 'heard': (int, 8), 'total': int}",
)


@pytest.fixture
def swarm(tmp_path):
    """Return a function that makes groups of one robot each, on a line 20 cm apart."""
    (tmp_path / "sender.py").write_text(SENDER)

    def make(*parameters, **signal):
        robot = {"controller": str(tmp_path / "sender.py"), "signal": {"kind": "radio", **signal}}
        poses = [[[10 + 20 * place, 20, 0]] for place in range(len(parameters))]
        groups = [robot | {"poses": at, "parameters": given} for at, given in zip(poses, parameters, strict=True)]
        arena = {"width_cm": 20 * len(parameters) + 20, "height_cm": 40}
        return Simulation({"arena": arena, "robots": groups}, 1, interpret=True)

    return make


def pulses(simulation, steps):
    return [[int(memory["pulses"][0]) for memory in simulation.advance(1).memories] for _ in range(steps)]


SEND, LISTEN = {}, {"first": 10**6}


def test_a_pulse_arrives_once_in_the_step_after_it_was_sent_or_later_by_the_latency(swarm):
    for latency_ms, late in ((0, 1), (1, 2), (100, 2), (250, 4)):
        heard = pulses(swarm(SEND, LISTEN, latency_ms=latency_ms), 10)
        assert heard == [[0, int(step == 3 + late)] for step in range(10)]


def test_a_message_arrives_with_its_pulse_and_a_flash_without_one(swarm):
    simulation = swarm({"message": 77}, SEND, LISTEN)
    simulation.advance(4)
    step = simulation.advance(1)
    heard = step.memories[2]
    assert heard["pulses"][0] == 2
    assert heard["heard"][0].tolist() == [77, 0, 0, 0, 0, 0, 0, 0]
    assert step.camera[:, 0].tolist() == [1, 1, 1]
    assert simulation.advance(1).memories[2]["heard"][0].tolist() == [0] * 8


@pytest.mark.parametrize(
    ("robots", "signal", "heard"),
    [
        # pulses pass through bodies, and end at the range
        ([SEND, LISTEN, LISTEN, LISTEN], {"range_cm": 40}, [0, 1, 1, 0]),
        ([LISTEN, SEND, LISTEN], {"angle_deg": 90, "of": "emission"}, [0, 0, 1]),
        ([LISTEN, SEND, LISTEN], {"angle_deg": 90}, [1, 0, 0]),
        *(([SEND, SEND, LISTEN], {"collisions": collide}, [1, 1, 0 if collide else 2]) for collide in (False, True)),
        *(([SEND, SEND, LISTEN], {"half_duplex": deaf}, [0, 0, 2] if deaf else [1, 1, 2]) for deaf in (False, True)),
        *(([SEND, LISTEN], {"loss": loss}, [0, 1 - loss]) for loss in (0, 1)),
    ],
)
def test_who_hears_a_pulse_of_the_step_before(swarm, robots, signal, heard):
    assert pulses(swarm(*robots, **signal), 5)[4] == heard


def test_pulses_are_lost_one_by_one_with_the_given_probability(swarm):
    steps = 2000
    step = swarm({"every": 2}, LISTEN, LISTEN, loss=0.3).advance(steps)
    sent = (steps - 4 + 1) // 2
    totals = np.array([int(memory["total"][0]) for memory in step.memories])
    assert totals[0] == 0
    assert (np.abs(totals[1:] - 0.7 * sent) < 4 * np.sqrt(0.21 * sent)).all()
    assert totals[1] != totals[2]
