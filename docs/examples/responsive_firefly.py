"""`firefly` with a phase response of any shape: how far a flash moves the phase, at eight phases and linear in between.

As it stands, the response is the thesis's (eq. 4.1, a tenth of the phase), and the robot equals `firefly` to the bit.
"""

from math import floor

import obstacle_avoidance
import oscillator

NODES = 8

PARAMETERS = obstacle_avoidance.PARAMETERS | {
    "period_s": 5.0,
    "flash_fraction": 0.075,
    "refractory_fraction": 0.15,
    "flash_pixels": 1,
    "response_1": 0.0125,  # periods by which a flash moves the phase where it is 1/8 of the period; none where it is 0
    "response_2": 0.0250,
    "response_3": 0.0375,
    "response_4": 0.0500,
    "response_5": 0.0625,
    "response_6": 0.0750,
    "response_7": 0.0875,
    "response_8": 0.1000,
}

MEMORY = obstacle_avoidance.MEMORY | {"phase_ms": int}


def start(memory, parameters, random):
    """Start moving, with a phase drawn uniformly from [0, tau)."""
    obstacle_avoidance.start(memory, parameters, random)
    memory.phase_ms = oscillator.randint(random, oscillator.whole_ms(parameters.period_s))


def response_ms(phase, period, parameters):
    """Return by how much a flash moves a phase, in ms."""
    p = parameters
    nodes = (
        0.0,
        p.response_1,
        p.response_2,
        p.response_3,
        p.response_4,
        p.response_5,
        p.response_6,
        p.response_7,
        p.response_8,
    )
    position = NODES * phase / period
    left = min(int(position), NODES - 1)
    share = position - left
    response = (1 - share) * nodes[left] + share * nodes[left + 1]
    return floor(response * period + 1e-6)  # as integers are truncated on the robot


def step(sensors, memory, actuators, parameters, random):
    """Move as Appendix B does, and run Algorithm 1 with this response."""
    obstacle_avoidance.step(sensors, memory, actuators, parameters, random)
    period = oscillator.whole_ms(parameters.period_s)
    phase = memory.phase_ms + sensors.step_ms
    acts = sensors.new_picture and oscillator.is_flash(sensors, parameters)
    if phase > oscillator.whole_ms(parameters.refractory_fraction * parameters.period_s) and acts:
        phase = max(0, phase + response_ms(phase, period, parameters))
    if phase >= period:
        phase = 0
        actuators.ring_on = True
    if phase > oscillator.whole_ms(parameters.flash_fraction * parameters.period_s):
        actuators.ring_on = False
    memory.phase_ms = phase
