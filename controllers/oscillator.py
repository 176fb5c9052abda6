"""The pulse-coupled oscillator of thesis section 4.1.2: Algorithm 1, and Algorithm 2 where `delay_ms` is above 0.

All times are whole milliseconds, as the e-puck has no floating-point unit; results are truncated.
"""

from epuck_sim.util.rng import randint

PARAMETERS = {
    "period_s": 5.0,  # tau
    "coupling": 0.1,  # epsilon: a flash multiplies the phase by 1 + epsilon
    "flash_fraction": 0.075,  # phi_LED / tau
    "refractory_fraction": 0.15,  # phi_ref / tau
    "delay_ms": 0,  # Delta of Algorithm 2; 62 on the robots, 0 makes it Algorithm 1
    "flash_pixels": 1,  # minimum number of red pixels of a flash; 2 on the robots (thesis 4.3.1)
    "once_per_sighting": False,  # True: one update for each sighting instead of one for each picture of it
}

MEMORY = {"phase_ms": int, "flash_seen": int}

PARTS = 1_000_000  # the coupling is an integer number of millionths, so that its products are integers


def check(parameters):
    """Refuse what Algorithms 1 and 2 do not allow."""
    if not 0.001 <= parameters.period_s <= 86_400:
        raise ValueError(f"period_s is {parameters.period_s}; allowed: 0.001 to 86400")
    if abs(whole_ms(parameters.period_s) - parameters.period_s * 1000) > 1e-3:
        raise ValueError(f"period_s is {parameters.period_s}; allowed: whole milliseconds")
    if parameters.coupling != 0 and not 0.000001 <= parameters.coupling <= 10:
        raise ValueError(f"coupling is {parameters.coupling}; allowed: 0, or 0.000001 to 10")
    if not 0 <= parameters.refractory_fraction < 1:
        raise ValueError(f"refractory_fraction is {parameters.refractory_fraction}; allowed: 0 to below 1")
    if not 0 <= parameters.flash_fraction <= parameters.refractory_fraction:
        raise ValueError(
            f"flash_fraction is {parameters.flash_fraction}; allowed: 0 to refractory_fraction, "
            f"which is {parameters.refractory_fraction} (Algorithm 1)"
        )
    if not 0 <= parameters.delay_ms <= parameters.flash_fraction * parameters.period_s * 1000:
        raise ValueError(
            f"delay_ms is {parameters.delay_ms}; allowed: 0 to the flash's length, flash_fraction x period_s, "
            f"which is {parameters.flash_fraction * parameters.period_s * 1000:g} ms (Algorithm 2)"
        )
    if parameters.flash_pixels < 1:
        raise ValueError(f"flash_pixels is {parameters.flash_pixels}; allowed: 1 and above")


def whole_ms(seconds):
    """Return whole milliseconds; the small addition keeps 1.001 s from becoming 1000 ms."""
    return int(seconds * 1000 + 1e-6)


def start(memory, parameters, random):
    """Draw the initial phase uniformly from [0, tau)."""
    memory.phase_ms = randint(random, whole_ms(parameters.period_s))
    memory.flash_seen = 0


def is_flash(sensors, parameters):
    """Return whether enough pixels are red."""
    return sensors.camera.sum() >= parameters.flash_pixels


def updated(phase, parameters):
    """Return Algorithm 2's PHASEUPDATE': the new phase, and whether a new cycle began at the flash.

    With no delay this is Algorithm 1's update (eq. 4.1). Line 2's modulo is left out: a phase beyond the refractory
    period exceeds the delay, and a phase that has passed the period must still fire, as in Algorithm 1.
    """
    period = whole_ms(parameters.period_s)
    factor = PARTS + int(parameters.coupling * PARTS + 0.5)
    fired = False
    phase = phase - parameters.delay_ms
    if phase > whole_ms(parameters.refractory_fraction * parameters.period_s):
        phase = phase * factor // PARTS
    if phase > period:
        phase = 0
        fired = True
    return phase + parameters.delay_ms, fired


def step(sensors, memory, actuators, parameters, random):
    """Run Algorithm 1, line by line; a picture acts only once, even if it stays for several steps (thesis 4.3.1)."""
    flash = is_flash(sensors, parameters)
    acts = flash and sensors.new_picture and not (parameters.once_per_sighting and memory.flash_seen)
    memory.flash_seen = int(flash)

    phase = memory.phase_ms + sensors.step_ms
    if phase > whole_ms(parameters.refractory_fraction * parameters.period_s) and acts:
        phase, fired = updated(phase, parameters)
        if fired:
            actuators.ring_on = True
    if phase >= whole_ms(parameters.period_s):
        phase = 0
        actuators.ring_on = True
    if phase > whole_ms(parameters.flash_fraction * parameters.period_s):
        actuators.ring_on = False
    memory.phase_ms = phase
