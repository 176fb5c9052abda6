"""Films that cameras and rooms spoil: the answer is right, or said to be doubtful."""

import cv2
import numpy as np
import pytest

from docs.figures.overhead_confidence import examine
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.floor import find_corners
from epuck_sim.overhead.light import ring_light
from epuck_sim.overhead.rings import DISC_LIGHT, RingFinder
from tests.overhead.cameras import camera_of, picture_of
from tests.overhead.effects import KINDS, padded


@pytest.mark.parametrize(
    ("kind", "strength"),
    [
        ("burnt out", 40.0),
        *(
            pytest.param(kind, strengths[-1], marks=pytest.mark.slow)
            for kind, (_, strengths) in KINDS.items()
            if kind not in {"burnt out", "rolling shutter"}  # flashes of 1.4 frames are cut in the middle
        ),
    ],
)
def test_an_answer_is_right_or_doubtful(kind: str, strength: float) -> None:
    _, confidence, is_right = examine(KINDS[kind][0](strength), 1, 1)
    assert is_right or confidence != "high"


@pytest.mark.parametrize(("kind", "strength"), [("lamp", 0.03), ("lamp", 0.06), ("screen", 0.08)])
def test_what_shines_and_flickers_is_told_from_rings_and_doubted(kind: str, strength: float) -> None:
    _, confidence, is_right = examine(KINDS[kind][0](strength), 1, 1)
    assert (is_right, confidence) == (True, "low")


def test_groups_apart_are_not_synchronised() -> None:
    cycles, confidence, _ = examine(iter, 3, 2)
    assert cycles == "" or confidence != "high"


def test_the_edge_of_padding_is_no_floor() -> None:
    wide = np.full((480, 560, 3), 145, np.uint8)
    wide[:, 40:-40] = picture_of([], room=True)
    assert find_corners(wide) is not None
    grey = np.full((480, 480, 3), 145, np.uint8)
    (frame,) = padded(0.1, 0.05)([Frame(0.0, grey)])
    assert find_corners(frame.picture) is None
    assert find_corners(np.pad(grey, ((40, 40), (60, 60), (0, 0)))) is None  # bars all round
    assert find_corners(np.pad(grey, ((40, 40), (60, 60), (0, 0)), constant_values=20)) is not None


def test_rings_that_are_burnt_out_to_discs_are_found_where_the_scale_is_known() -> None:
    camera = camera_of()
    places = np.array([(15.0, 15.0), (30.0, 40.0), (30.0 + 8.5, 40.0), (50.0, 20.0)])
    picture = np.zeros((480, 480, 3), np.uint8)
    px_per_cm = 480 / 65
    for x_px, y_px in camera.project(np.column_stack([places, np.full(4, 4.0)])):
        cv2.circle(picture, (round(x_px), round(y_px)), round(5.0 * px_per_cm), (255, 255, 255), -1)
    rings = RingFinder(camera, sees_discs=True).find(ring_light(picture))
    found = np.array(sorted((ring.x_cm, ring.y_cm) for ring in rings))
    assert found == pytest.approx(np.array(sorted(map(tuple, places))), abs=0.5)
    assert {ring.light for ring in rings} == {DISC_LIGHT}
    assert RingFinder(camera).find(ring_light(picture)) == []
