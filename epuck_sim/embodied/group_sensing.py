"""How the robots of a group sense, as compiled code calls it: infrared, and what brings flashes to them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from epuck_sim.arrays import IntArray
from epuck_sim.embodied.camera_clock import CameraClock, take_pictures
from epuck_sim.embodied.flash_cone import LitRingSensor, Obstruction, perceive_flashes
from epuck_sim.embodied.group import SignalReceiver
from epuck_sim.embodied.radio import Radio, receive_pulses
from epuck_sim.embodied.reflections import see_with_reflections
from epuck_sim.embodied.sensing import SensingArrays, sense, sense_proximity
from epuck_sim.embodied.swarm_arrays import NOISE_STEPS


class GroupSensing(NamedTuple):
    """How a group of robots senses."""

    step: IntArray
    """(1,) number of the control step."""
    sensing: SensingArrays
    receiver: SignalReceiver


if TYPE_CHECKING:  # `bind` provides it
    value_at: Callable[[int], Any]


def _sense_with_camera(address: int) -> None:
    """Have the robots of a group sense that see flashes with their cameras."""
    group = value_at(address)  # noqa: F821 see `bind`
    sense(group.sensing, group.step[0] % NOISE_STEPS)
    take_pictures(group.receiver, group.step[0])


def _sense_with_reflections(address: int) -> None:
    """Have the robots of a group sense whose cameras see mirror images of rings, too."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays = group.sensing
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    see_with_reflections(arrays, arrays.ring_on, arrays.first_robot, arrays.pixels)
    take_pictures(group.receiver, group.step[0])


def _sense_with_cone(address: int) -> None:
    """Have the robots of a group sense that perceive flashes with the ideal sensor."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays, sensor = group.sensing, group.receiver
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    among = Obstruction(arrays.poses, arrays.circles, arrays.edges, arrays.cells, arrays.radius_cm)
    perceive_flashes(sensor.cone, sensor.occlusion, arrays.ring_on, among, arrays.first_robot, arrays.pixels)


def _sense_with_radio(address: int) -> None:
    """Have the robots of a group sense that receive pulses by radio."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays = group.sensing
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    receive_pulses(group.receiver, arrays.poses, arrays.ring_on, arrays.first_robot, group.step[0])


_SENSE = {CameraClock: _sense_with_camera, LitRingSensor: _sense_with_cone, Radio: _sense_with_radio}
"""How a group of robots senses, by what brings flashes to it; with reflections, `_sense_with_reflections`."""


def sensing_of(group: GroupSensing) -> Callable[[int], None]:
    """Return what has a group sense, as a function of its address."""
    if group.sensing.camera.reflection_range_cm > 0:
        return _sense_with_reflections
    return _SENSE[type(group.receiver)]
