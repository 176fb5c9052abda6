"""Bounding boxes contain all pixels of a body, and not many more."""

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim import epuck
from epuck_sim.overhead.camera import LOOKING_DOWN, CameraModel, simple_lens
from epuck_sim.overhead.render import bounding_boxes


@given(st.floats(4, 56), st.floats(4, 56), st.sampled_from([-0.1, 0.0, 0.1]), st.floats(0, 0.1))
def test_bounding_boxes_contain_every_pixel_of_a_body(x: float, y: float, k1: float, tilt: float) -> None:
    rotation, _ = cv2.Rodrigues(np.array([tilt, 0.5 * tilt, 0]))
    camera = CameraModel(
        160, 160, simple_lens(160, 160, 180.0, k1), rotation @ LOOKING_DOWN, np.array([30.0, 30.0, 110.0])
    )
    inside = np.zeros((160, 160), bool)
    for height in (0.0, epuck.HEIGHT_CM):
        shown = camera.plane_map(height)
        inside |= np.hypot(shown[..., 0] - x, shown[..., 1] - y) <= epuck.RADIUS_CM
    first, after, left, right = bounding_boxes(camera, np.array([[x, y]]), epuck.RADIUS_CM, (0.0, epuck.HEIGHT_CM))[0]
    assert inside[first:after, left:right].sum() == inside.sum()
    assert (after - first) * (right - left) <= 2.5 * inside.sum()
