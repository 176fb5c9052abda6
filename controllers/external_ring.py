"""A robot that moves as `obstacle_avoidance` does, with its ring commanded from outside: for signals to others."""

import obstacle_avoidance

PARAMETERS = obstacle_avoidance.PARAMETERS

MEMORY = obstacle_avoidance.MEMORY

EXTERNAL = ("ring",)

check = obstacle_avoidance.check

start = obstacle_avoidance.start

step = obstacle_avoidance.step
