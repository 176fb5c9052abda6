"""Changes while a trial runs: faults, robots that come and go, other walls, other parameters, other controllers.

May import: the swarm, places, sensors, bodies and controllers of this room, and what they may; never the loop.
"""
