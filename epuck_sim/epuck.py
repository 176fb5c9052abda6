"""The e-puck: its body, wheels, infrared sensors and camera, every constant with its source.

Frame of the body: x forward, y left, angles counter-clockwise, origin on the axle's centre.
"""

import numpy as np

RADIUS_CM = 3.7  # radius of the cylindrical body (thesis 3.1.4.1: diameter 7.4 cm)
HEIGHT_CM = 4.7  # height of the body (e-puck data sheet)
RING_HEIGHT_CM = 4.0  # height of the ring of eight red LEDs above the floor; our estimate: no source states it
RING_RADIUS_CM = 3.5  # radius of the ring of LEDs; our estimate: no source states it
MASS_G = 152.0  # mass (thesis 3.1.4.1)
WHEEL_BASE_CM = 5.1  # distance between the wheels (thesis 3.1.4.1)
WHEEL_LIMIT_CM_S = 12.8  # largest speed of a wheel, forwards or backwards (thesis 3.1.4.1)

# --- infrared proximity sensors: numbered clockwise seen from above, from front-right -------------

INFRARED_SENSORS = (
    (3.35, -1.05, -18.0),
    (2.30, -2.60, -45.0),
    (0.00, -3.30, -90.0),
    (-3.00, -1.80, -142.0),
    (-3.00, 1.80, 142.0),
    (0.00, 3.30, 90.0),
    (2.30, 2.60, 45.0),
    (3.35, 1.05, 18.0),
)
"""Position in cm, and direction in degrees, of each sensor (Enki 2.x e-puck model)."""

INFRARED_SPREAD_DEG = 15.0
"""Angle in degrees between a sensor's centre ray and each of its two side rays (Enki 2.x e-puck model)."""

INFRARED_RANGE_CM = 12.0  # range of an infrared ray (Enki 2.x e-puck model)

INFRARED_PEAK_COUNTS = 3731.0
"""Largest reading, m of the response m (c - x0^2) / (x^2 - 2 x0 x + c) (Enki 2.x e-puck model)."""

INFRARED_PEAK_CM = 0.3  # distance of the largest reading, x0 of the infrared response (Enki 2.x e-puck model)
INFRARED_WIDTH_CM2 = 0.7  # width of the peak, c of the infrared response (Enki 2.x e-puck model)

INFRARED_TABLE_COUNTS = np.array([4095.0, 3756.0, 3591.0, 558.0, 133.0, 58.0, 29.0])
"""(7,) counts above ambient light, falling: readings of the firmware's table of distances (e-puck firmware)."""

INFRARED_TABLE_MM = np.array([0.0, 3.0, 10.0, 25.0, 50.0, 75.0, 100.0])
"""(7,) mm: distances of the readings `INFRARED_TABLE_COUNTS` (e-puck firmware)."""

OUT_OF_RANGE_MM = 65535  # distance that stands for "nothing in range" (e-puck firmware); no real distance is as large
GRID_SPACING_CM = 10.0  # distance between the points of the grid in cm (thesis 4.3.1)
