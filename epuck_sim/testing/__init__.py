"""Unit tests of controllers: a robot whose sensors are set by hand, and scenes of the simulator in one line.

The fixture of pytest is in `epuck_sim.pytest_plugin`.
"""

from epuck_sim.testing.robot import TestRobot, facing_robot, facing_wall

__all__ = ["TestRobot", "facing_robot", "facing_wall"]
