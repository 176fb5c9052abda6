"""A lens is calibrated from a board, kept in a file, and read again; what cannot be is refused in clear words."""

from collections.abc import Sequence

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from epuck_sim.errors import FilmError
from epuck_sim.overhead import lens
from epuck_sim.overhead.camera import CameraModel, Frame, Lens
from epuck_sim.overhead.lens import MIN_VIEWS, Board, View, calibrate_lens, find_views, read_lens, save_lens
from tests.overhead.cameras import charuco, checkerboard, film_of, lens_matrix

SIZE = (480, 360)


def error_px(found: Lens, true_lens: Lens) -> float:
    """Return by how many pixels, at most, a lens shows points elsewhere than the true one."""
    points = np.array([(x, y, 10.0) for x in (-4.0, 0.0, 4.0) for y in (-3.0, 0.0, 3.0)])
    shown = [CameraModel(*SIZE, each, np.eye(3), np.zeros(3)).project(points) for each in (found, true_lens)]
    return float(np.linalg.norm(shown[0] - shown[1], axis=1).max())


@pytest.mark.parametrize(
    ("kind", "draw", "coefficients", "is_fisheye"),
    [
        ("checkerboard", checkerboard, (-0.25, 0.05, 0.0, 0.0), False),
        ("charuco", charuco, (-0.1, 0.0, 0.0, 0.0), False),
        ("checkerboard", checkerboard, (0.02, -0.01, 0.0, 0.0), True),
    ],
)
def test_a_board_tells_the_lens(kind, draw, coefficients, is_fisheye, tmp_path) -> None:
    matrix = lens_matrix(315.0, SIZE)
    true_lens = Lens(matrix[0, 0], matrix[1, 1], (matrix[0, 2], matrix[1, 2]), coefficients, is_fisheye)
    views = find_views(film_of(draw(9, 6), matrix, np.array(coefficients), is_fisheye, SIZE, 10), Board(kind, 9, 6))
    found = calibrate_lens("film", views, SIZE, is_fisheye)
    assert found.views >= MIN_VIEWS
    assert found.error_px < 0.5
    assert error_px(found.lens, true_lens) < 3.0
    save_lens(tmp_path / "lens.json", found)
    assert read_lens(tmp_path / "lens.json", SIZE) == found.lens
    text = (tmp_path / "lens.json").read_text()
    (tmp_path / "lens.json").write_text(text.replace('"error_px": 0.', '"error_px": 1.'))
    with pytest.raises(FilmError, match="was changed since epuck-sim calibrate wrote it; calibrate again"):
        read_lens(tmp_path / "lens.json", SIZE)


def test_a_board_that_is_not_there_is_missed_in_clear_words() -> None:
    nothing = [Frame(float(second), np.full((120, 160, 3), 120, np.uint8)) for second in range(10)]
    views = find_views(nothing, Board("checkerboard", 9, 6))
    with pytest.raises(FilmError, match=r"^dull\.mp4: the board is found in 0 different positions; .*--board"):
        calibrate_lens("dull.mp4", views, (160, 120), False)


def views_of_a_board(tilts_deg: Sequence[float], is_fisheye: bool) -> list[View]:
    """Return views through a lens of 450 px, with noise of 0.1 px, of a board that is moved, turned and tilted."""
    random = np.random.default_rng(3)
    across, down = np.meshgrid(np.arange(6.0), np.arange(4.0))
    board = np.column_stack([across.ravel(), down.ravel(), np.zeros(across.size)])[:, None]
    views, project = [], cv2.fisheye.projectPoints if is_fisheye else cv2.projectPoints
    for tilt_deg in tilts_deg:
        turn = Rotation.from_euler("zx", [random.uniform(-40, 40), tilt_deg], degrees=True).as_rotvec()
        shift = np.array([*random.uniform(-6, -1, 2), random.uniform(12, 18)])
        pixels, _ = project(board, turn, shift, lens_matrix(450.0, SIZE), np.zeros(4))
        noisy = (pixels + random.normal(0, 0.1, pixels.shape)).reshape(-1, 2)
        views.append(dict(zip(map(tuple, board[:, 0].tolist()), noisy, strict=True)))
    return views


@pytest.mark.parametrize(("is_fisheye", "tilt_deg"), [(False, 0.0), (False, 12.0), (True, 12.0)])
def test_a_board_that_is_never_or_always_tilted_alike_does_not_determine_a_lens(is_fisheye: bool, tilt_deg) -> None:
    views = views_of_a_board(np.linspace(-35, 35, 12), is_fisheye)
    assert calibrate_lens("film", views, SIZE, is_fisheye).focal_px == pytest.approx(450, rel=0.02)
    with pytest.raises(FilmError, match=r"^film: the views of the board do not determine a lens; show it tilted"):
        calibrate_lens("film", views_of_a_board([tilt_deg] * 12, is_fisheye), SIZE, is_fisheye)


def test_corners_that_come_and_go_are_no_movement_and_pictures_are_all_searched(monkeypatch) -> None:
    (view,) = views_of_a_board([20.0], False)
    flickers = [dict([*view.items()][number:]) for number in (0, 1, 0, 1)]
    views = views_of_a_board(np.linspace(-30, 30, 10), False)
    monkeypatch.setattr(lens, "_charuco_corners", lambda *_: flickers.pop())
    monkeypatch.setattr(lens, "_checkerboard_corners", lambda *_: views.pop())
    frames = [Frame(number / 25, np.zeros((4, 4, 3), np.uint8)) for number in range(10)]
    assert len(find_views(frames[:4], Board("charuco", 9, 6), apart_s=0.0)) == 1
    assert len(find_views(frames, Board("checkerboard", 9, 6), apart_s=0.0)) == 10


LENS = (
    '{"width_px": 640, "height_px": 480, "focal_px": 500, "focal_down_px": 500, "middle_px": [319, 239],'
    ' "coefficients": [0, 0, 0, 0], "is_fisheye": false}'
)


def test_files_that_are_no_lens_of_this_camera_are_refused(tmp_path) -> None:
    path = tmp_path / "lens.json"
    with pytest.raises(FilmError, match=r"lens\.json: no such file"):
        read_lens(path, (480, 480))
    for text, why in [
        ("nothing", "is not a lens"),
        ("{}", "is not a lens"),
        (LENS.replace("500", "-5"), "is not a lens"),
        ("[" * 100_000, "is not a lens"),
        (LENS, "was calibrated for pictures of 640 x 480 px, but these are 480 x 480"),
    ]:
        path.write_text(text)
        with pytest.raises(FilmError, match=rf"lens\.json: {why}"):
            read_lens(path, (480, 480))
