"""Sensors of robots: a file for each, with the function (block, addresses, group) that a step calls.

May import: embodied's `swarm` and `cells`, and what the room may import.
"""
