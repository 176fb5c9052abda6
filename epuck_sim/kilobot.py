"""The Kilobot: its body and how it moves, every constant with its source.

It has neither proximity sensors nor a camera. Kilobots talk by infrared light that the table reflects, under each
other's bodies: by a signal `radio` with a range (docs/other_robots.md).
"""

RADIUS_CM = 1.65
"""Radius of the body (Rubenstein et al. 2012: diameter 3.3 cm)."""

HEIGHT_CM = 3.4
"""Height of the body with its legs (K-Team data sheet)."""

RING_HEIGHT_CM = 3.4
"""Height of its only LED above the floor, which stands for a ring of LEDs (ARGoS Kilobot model: on top of the body)."""

RING_RADIUS_CM = 0.4
"""Radius of the ring of LEDs that stands for the LED (ARGoS Kilobot model: a quarter of the body's radius)."""

MASS_G = 24.0
"""Mass; our estimate: models have 10 g and 24 g, and no source states it."""

WHEEL_BASE_CM = 2.5
"""Distance between the wheels that stand for its vibrating legs (ARGoS Kilobot model: distance of the two rear legs).

At the legs' largest speed the robot turns by 46 degrees in a second, as it should: 45 (Rubenstein et al. 2012).
"""

WHEEL_LIMIT_CM_S = 1.0
"""Largest speed of a wheel (Rubenstein et al. 2012: about 1 cm/s); unlike ours, legs do not go backwards."""
