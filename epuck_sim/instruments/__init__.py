"""The shipped measures, each a class that `measures.shipped` names.

May import: embodied, particles and what they may import; for types alone, because `check` loads no simulation.
"""
