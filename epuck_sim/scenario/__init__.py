"""Reading of YAML into one validated, immutable scenario, and into the points of its sweep.

May import: control, util and the modules of the package's root.
"""
