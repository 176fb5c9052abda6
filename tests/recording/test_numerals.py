"""Numbers beside the rows of a picture are drawn within their rows."""

import numpy as np

from epuck_sim.recording.layers.arena import row_numbers


def test_each_number_is_within_its_row_and_left_of_the_picture() -> None:
    strips = [np.array(strip) for strip in row_numbers(12).strips.as_arrow_array().to_pylist()]
    assert len(strips) == 10 + 2 * 2
    rows = [*range(10), 10, 10, 11, 11]
    for row, strip in zip(rows, strips, strict=True):
        assert row < strip[:, 1].min() < strip[:, 1].max() < row + 1
        assert strip[:, 0].max() < 0
    assert strips[10][:, 0].max() < strips[11][:, 0].min()
