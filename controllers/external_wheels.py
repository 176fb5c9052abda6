"""An `oscillator` whose wheels are commanded from outside: for motions that make a swarm synchronise."""

import oscillator

PARAMETERS = oscillator.PARAMETERS

MEMORY = oscillator.MEMORY

EXTERNAL = ("wheels",)

check = oscillator.check

start = oscillator.start

step = oscillator.step
