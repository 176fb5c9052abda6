"""The model of chapter 4: e-pucks with bodies, infrared sensors, cameras and controllers, step by step.

May import: scenario, control, util and the modules of the package's root; never particles.
"""
