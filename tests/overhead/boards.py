"""Films of boards, as a lens that is known shows them."""

import cv2
import numpy as np

from epuck_sim.overhead.camera import Frame

SQUARE_PX = 60


def checkerboard(columns, rows):
    """Return a picture of a board of squares, white around it."""
    cells = np.indices((rows, columns)).sum(axis=0) % 2
    board = np.kron(np.where(cells, 255, 20), np.ones((SQUARE_PX, SQUARE_PX))).astype(np.uint8)
    return np.pad(board, SQUARE_PX, constant_values=255)


def charuco(columns, rows):
    """Return a picture of a ChArUco board, white around it."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    board = cv2.aruco.CharucoBoard((columns, rows), 1.0, 0.7, dictionary)
    drawn = board.generateImage((columns * SQUARE_PX, rows * SQUARE_PX))
    return np.pad(drawn, SQUARE_PX, constant_values=255)


def rays_of(matrix, coefficients, is_fisheye, size):
    """Return (3, pixels) where each pixel looks, at distance 1 before the camera."""
    columns, rows = np.meshgrid(np.arange(size[0], dtype=float), np.arange(size[1], dtype=float))
    pixels = np.column_stack([columns.ravel(), rows.ravel()]).reshape(-1, 1, 2)
    straighten = cv2.fisheye.undistortPoints if is_fisheye else cv2.undistortPoints
    return np.vstack([straighten(pixels, matrix, coefficients).reshape(-1, 2).T, np.ones(len(pixels))])


def show(board, rays, size, seed):
    """Return a grey picture of a board somewhere before the camera, pixel by pixel through the lens."""
    generator = np.random.default_rng(seed)
    turn = cv2.Rodrigues(generator.uniform(-0.45, 0.45, 3))[0]
    middle = np.array([*generator.uniform(-0.25, 0.25, 2), 1.0]) * generator.uniform(10, 15)
    normal = turn[:, 2]
    points = rays * (middle @ normal / (normal @ rays)) - middle[:, None]
    on_board = turn[:, :2].T @ points
    half = np.array(board.shape[::-1]) / 2
    x, y = (on_board * SQUARE_PX + half[:, None]).astype(np.float32).reshape(2, size[1], size[0])
    shown = cv2.remap(board, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=90)
    return cv2.GaussianBlur(shown, (0, 0), 0.8)


def film(board, matrix, coefficients, is_fisheye=False, size=(640, 480), views=14):
    """Yield frames, a second apart, of a board that is moved."""
    rays = rays_of(matrix, coefficients, is_fisheye, size)
    for seed in range(views):
        grey = show(board, rays, size, seed)
        yield Frame(float(seed), np.repeat(grey[..., None], 3, axis=2))


def lens_matrix(focal_px, size=(640, 480)):
    return np.array([[focal_px, 0, size[0] / 2 + 6], [0, focal_px * 1.01, size[1] / 2 - 4], [0, 0, 1]])
