"""What robots sense: a file for each kind of sensor, with the function (block, addresses, group) that a step calls.

May import: embodied's `swarm` and `cells`, and what the room may import.
"""
