"""The model of chapters 3 and 5: point agents and their oscillators, from event to event.

May import: scenario, control, util and the modules of the package's root; never embodied.
"""
