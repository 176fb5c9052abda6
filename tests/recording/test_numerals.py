"""Numbers beside the rows of a picture are drawn within their rows, and those of robots have contrast."""

import numpy as np

from epuck_sim.recording.layers.arena import DARK, LIT, NIGHT, WHITE, row_numbers


def test_each_number_is_within_its_row_and_left_of_the_picture() -> None:
    strips = [np.array(strip) for strip in row_numbers(12).strips.as_arrow_array().to_pylist()]
    assert len(strips) == 10 + 2 * 2
    rows = [*range(10), 10, 10, 11, 11]
    for row, strip in zip(rows, strips, strict=True):
        assert row < strip[:, 1].min() < strip[:, 1].max() < row + 1
        assert strip[:, 0].max() < 0
    assert strips[10][:, 0].max() < strips[11][:, 0].min()


def test_numbers_of_robots_have_contrast_on_their_discs_in_every_theme() -> None:
    def luminance(colour: tuple[int, int, int]) -> float:
        """Return the relative luminance of WCAG 2."""
        share = np.array(colour) / 255
        return float(
            np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4) @ (0.2126, 0.7152, 0.0722)
        )

    for below in (LIT, DARK, NIGHT):
        assert (luminance(WHITE) + 0.05) / (luminance(below) + 0.05) >= 4.5
