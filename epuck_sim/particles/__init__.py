"""Chapters 3 and 5: point-like agents with oscillators, simulated from event to event.

May import: scenario, control, util and the modules of the package's root; never embodied.
"""
