"""The lit area of the floor, which lamps that flicker do not change."""

import numpy as np
import pytest

from epuck_sim.overhead.camera import Geometry
from epuck_sim.overhead.light import LightMeter, ring_light
from tests.overhead.track.films import make_camera, make_geometry

ROWS = COLUMNS = 240
DARK = np.zeros((ROWS, COLUMNS, 3), np.uint8)
SPOTS = [(40, 60), (150, 62), (200, 180)]
SPOT_PX = 10


def room(level: float, flicker: float, bands: float, turned: bool, spots: int) -> np.ndarray:
    """Return a picture of a room with light in bands, and square spots of light."""
    along = np.arange(ROWS) / ROWS * bands * 2 * np.pi
    levels = np.repeat(level * (1 + flicker * np.sin(along))[:, None], COLUMNS, axis=1)
    for row, column in SPOTS[:spots]:
        levels[row : row + SPOT_PX, column : column + SPOT_PX] += 100
    levels = levels.T if turned else levels
    return np.repeat(levels[:, :, None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize("knows_floor", [True, False])
@pytest.mark.parametrize("turned", [True, False])
@pytest.mark.parametrize(("flicker", "bands"), [(0, 0), (0.4, 0), (0.4, 0.5), (0.4, 2.5), (0.8, 7)])
def test_lamps_that_flicker_change_nothing(flicker: float, bands: float, turned: bool, knows_floor: bool) -> None:
    meter = LightMeter(Geometry(make_camera(), (60.0, 60.0), "somewhere", knows_floor))
    background = room(20 * (1 - flicker), 0, 0, False, 0)
    for spots in range(4):
        steady = meter.lit_px(ring_light(room(0, 0, 0, turned, spots), DARK).levels)
        assert steady == pytest.approx(spots * (SPOT_PX + 1) ** 2, rel=0.3)
        assert meter.lit_px(ring_light(room(20, flicker, bands, turned, spots), background).levels) == pytest.approx(
            steady, rel=0.1
        )


def test_light_outside_of_the_floor_does_not_count() -> None:
    geometry = make_geometry()
    outside = DARK.copy()
    outside[:4, :100] = outside[100:200, -4:] = 200
    assert LightMeter(geometry).lit_px(ring_light(outside, DARK).levels) == 0
    assert LightMeter(geometry._replace(knows_floor=False)).lit_px(ring_light(outside, DARK).levels) > 700
