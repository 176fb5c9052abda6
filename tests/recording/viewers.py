"""Viewers for tests: what is drawn in a picture, open ports, programs that stand in for rerun's, and signals."""

import json
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from urllib.request import ProxyHandler, build_opener

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage
from scipy.spatial import ConvexHull

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.recording import rerun
from tests.processes import processes_marked, wait_until

# as in `layers.arena.RINGS`
LIT, DARK = (220, 40, 30), (62, 67, 78)

ARENA = np.s_[172:660, :955]
"""In a picture of 1600 x 900: columns are laid out as 3 to 2, rows as 3 to 1; words are above."""

TELL = """
import json, os, pathlib, socket, sys, time
received = {"arguments": sys.argv[1:], "analytics": os.environ.get("RERUN_ANALYTICS")}
pathlib.Path(__file__).with_suffix(".json").write_text(json.dumps(received))
"""

ANSWER_AND_BREAK_DOWN = """
ports = [int(sys.argv[sys.argv.index(name) + 1]) for name in ("--port", "--web-viewer-port") if name in sys.argv]
servers = [socket.create_server(("127.0.0.1", port)) for port in ports]
callers = [server.accept() for server in [*servers, *servers[:SENDERS]]]
print(SAID, file=sys.stderr, flush=True)
sys.exit(1)
"""


@contextmanager
def nothing_left(mark: Path) -> Iterator[None]:
    """Fail if a process that the block starts outlives it; end all of them, however the block ends."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("EPUCK_SIM_TEST", str(mark))
        try:
            yield
            wait_until(lambda: not processes_marked(str(mark)))
        finally:
            for left in processes_marked(str(mark)):
                with suppress(ProcessLookupError):
                    os.kill(left, signal.SIGKILL)


def pixels(png: Path | BytesIO) -> FloatArray:
    with Image.open(png) as picture:
        assert picture.format == "PNG"
        return np.asarray(picture.convert("RGB"), float)


def alike(picture: FloatArray, colour: Sequence[int]) -> BoolArray:
    """Return where a picture has a colour, in the light or in the shade."""
    pure = np.array(colour, float)
    shade = picture @ pure / (pure @ pure)
    return (abs(picture - shade[..., None] * pure).max(axis=-1) < 25) & (shade > 0.4) & (shade < 1.2)


def discs(picture: FloatArray, colour: Sequence[int]) -> FloatArray:
    """Return (discs, 3) x, y and radius from left to right, in pixels, of what is thick and round.

    Arrows and numbers lie on them, which are white: a circle is put around what is left.
    """
    whole = ndimage.binary_closing(alike(picture, colour) | (picture.min(axis=-1) > 190), iterations=2)
    found, count = ndimage.label(ndimage.binary_opening(whole, iterations=8))
    circles = []
    for disc in range(1, count + 1):
        points = np.argwhere(found == disc)[:, ::-1]
        rim = points[ConvexHull(points).vertices].astype(float)
        equations = np.column_stack([2 * rim, np.ones(len(rim))])
        (x, y, rest), *_ = np.linalg.lstsq(equations, (rim**2).sum(axis=1), rcond=None)
        circles.append((x, y, np.sqrt(rest + x**2 + y**2)))
    return np.array(sorted(circle for circle in circles if circle[2] > 10)).reshape(-1, 3)  # numbers are smaller


class Stand(NamedTuple):
    script: Path

    def acts(self, *lines: str) -> None:
        self.script.write_text("\n".join([TELL, *lines]))

    def answers_and_says(self, said: str, senders: int = 0) -> None:
        """Have it answer at its ports, once more at the first one if there are `senders`, and fail then."""
        self.acts(f"SAID, SENDERS = {said!r}, {senders}", ANSWER_AND_BREAK_DOWN)

    @property
    def received(self) -> dict[str, Any]:
        return json.loads(self.script.with_suffix(".json").read_text())


def replace_rerun(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Stand:
    """Return a program that stands for rerun's, and ends at once unless `acts` says otherwise."""
    folder.mkdir()
    monkeypatch.setattr(rerun, "PROGRAM", (sys.executable, str(folder / "rerun.py")))
    stand = Stand(folder / "rerun.py")
    stand.acts()
    return stand


def answer(address: str) -> str:
    with build_opener(ProxyHandler({})).open(address, timeout=30) as page:
        assert page.status == 200
        return page.read().decode()
