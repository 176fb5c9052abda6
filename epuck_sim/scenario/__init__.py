"""From YAML to one validated, immutable scenario, and to the points of its sweep.

May import: control, util and the modules of the package's root.
"""
