"""The motion algorithm of thesis Appendix B: straight ahead, a small turn at a robot, a random one at a wall.

Whole numbers and C's truncation toward zero, as on the robot; speeds in mm/s.
"""

from epuck_sim.util.rng import randint

PARAMETERS = {
    "speed_cm_s": 12.8,  # V, straight ahead
    "proximity_threshold": 70,  # proxThres: nearer than 100 - 70 = 30 mm is close
    "proximity_count_threshold": 5,  # proxCountThres: an object that is close for more steps is a wall
    "rotation_max": 25,  # rotMax: maximum duration of a random turn, in steps
    "rotation_speed_cm_s": 12.8,  # MAX_SPEED
}

MEMORY = {"rotation_time": int, "proximity_count": int, "left_mm_s": float, "right_mm_s": float}

FRONT = (5, 6, 7, 0, 1, 2)  # the front six of the eight sensors
ANGLE_X = (96, 70, 0, -88, -88, 0, 70, 96)  # hundredths; x ahead
ANGLE_Y = (30, 72, 100, 48, -48, -100, -72, -30)  # hundredths; y to the robot's right


def check(parameters):
    """Refuse speeds beyond the wheels' limit, and counts that make no sense."""
    for name in ("speed_cm_s", "rotation_speed_cm_s"):
        speed = getattr(parameters, name)
        if not 0 <= speed <= 12.8:
            raise ValueError(f"{name} is {speed}; allowed: 0 to 12.8, the wheels' limit")
    if parameters.rotation_speed_cm_s != int(parameters.rotation_speed_cm_s * 10 + 0.5) / 10:
        raise ValueError(f"rotation_speed_cm_s is {parameters.rotation_speed_cm_s}; allowed: whole mm/s, steps of 0.1")
    if not 0 <= parameters.proximity_threshold < 100:
        raise ValueError(f"proximity_threshold is {parameters.proximity_threshold}; allowed: 0 to 99")
    if parameters.proximity_count_threshold < 0:
        raise ValueError(f"proximity_count_threshold is {parameters.proximity_count_threshold}; allowed: 0 and above")
    if not 1 <= parameters.rotation_max <= 1_000_000:
        raise ValueError(f"rotation_max is {parameters.rotation_max}; allowed: 1 to 1000000")


def start(memory, parameters, random):
    """Initialise the static variables of Appendix B."""
    memory.rotation_time = 0
    memory.proximity_count = 0
    memory.left_mm_s = 0
    memory.right_mm_s = 0


def quotient(dividend, divisor):
    """Return the quotient as C's integer division does, truncated toward zero."""
    return int(dividend / divisor)


def proximity(distance_mm):
    """Return getProximityValues: the nearness, from 0 (beyond 100 mm) to 100 (touching)."""
    return 0 if distance_mm > 100 else 100 - distance_mm


def proximity_pointer(sensors, parameters):
    """Return calculateProxPointer: the vector to the middle of close objects."""
    x = 0
    y = 0
    for sensor in FRONT:
        near = proximity(sensors.distance_mm[sensor])
        if near > parameters.proximity_threshold:
            x += quotient(near * ANGLE_X[sensor], 100)
            y += quotient(near * ANGLE_Y[sensor], 100)
    return x, y


def choose_speeds(x, y, memory, parameters, random):
    """Run calculateMotorSpeed: forward, or a turn away from an object at (x, y)."""
    threshold = parameters.proximity_threshold
    turn = int(parameters.rotation_speed_cm_s * 10 + 0.5)

    if memory.rotation_time > 0 or memory.proximity_count > 0:
        if abs(x) > threshold or abs(y) > threshold:
            memory.proximity_count += 1
        else:
            memory.proximity_count = 0

    direction = 1 if y > 0 else -1  # 1 turns left, -1 turns right

    if memory.proximity_count > parameters.proximity_count_threshold:
        memory.left_mm_s = -turn * direction
        memory.right_mm_s = turn * direction
        memory.rotation_time += 1 + randint(random, parameters.rotation_max)
        memory.proximity_count = 0

    if x > threshold:
        if memory.proximity_count == 0:
            memory.left_mm_s = -turn * direction
            memory.right_mm_s = turn * direction
        else:  # low-pass, so that noise cannot make it toggle
            memory.left_mm_s = quotient(memory.left_mm_s, 2) - quotient(turn * direction, 2)
            memory.right_mm_s = quotient(memory.right_mm_s, 2) + quotient(turn * direction, 2)
        memory.rotation_time = 1
    elif memory.rotation_time == 0:
        # a speed below 1 mm/s keeps its fraction: the thesis's sweeps begin near standstill
        memory.left_mm_s = parameters.speed_cm_s * 10
        memory.right_mm_s = parameters.speed_cm_s * 10
    else:
        memory.rotation_time -= 1


def step(sensors, memory, actuators, parameters, random):
    """Run motionAlgorithm."""
    x, y = proximity_pointer(sensors, parameters)
    choose_speeds(x, y, memory, parameters, random)
    actuators.left_cm_s = memory.left_mm_s / 10
    actuators.right_cm_s = memory.right_mm_s / 10
