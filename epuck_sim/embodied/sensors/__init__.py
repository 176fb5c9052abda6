"""What robots sense: a file for each sensor, each with the function (block, addresses, group) that a step calls.

May import: embodied's `swarm` and `cells`, and what the room may import.
"""
