"""How recordings show themselves in notebooks: as a table and a picture, or in rerun's viewer; and films, too."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from epuck_sim.display.arena_svg import draw_arena
from epuck_sim.display.html import element, facts, to_html
from epuck_sim.errors import EpuckSimError
from epuck_sim.recording.rows import population_of

if TYPE_CHECKING:  # a recording shows itself by this module
    from epuck_sim.recording.recorded import Recorded

WIDTH_PX, HEIGHT_PX = 960, 600
"""Size of the viewer in a notebook."""

NEEDED = "showing needs Jupyter's parts, which are not installed: pip install 'epuck-sim[notebook]'"


def show_recorded(recorded: "Recorded") -> str:
    """Return a recording as HTML: the last moment at which most rings were lit, and what is recorded."""
    population = population_of(recorded.scenario)
    rows = [
        (f"{population.noun}s", str(population.size)),
        ("level", str(recorded.level)),
        ("duration", f"{recorded.time_s[-1] if len(recorded.time_s) else 0:.1f} s, {recorded.cycles} cycles"),
        ("synchronised", "yes" if recorded.synchronised else "no"),
        ("rows", str(len(recorded.time_s))),
    ]
    parts = [element("p", element("b", recorded.scenario.name), f", seed {recorded.seed}"), facts(rows)]
    if len(recorded.ring_on):
        rings = recorded.ring_on.sum(axis=1)
        moment = int(np.flatnonzero(rings == rings.max())[-1])
        poses = np.column_stack([recorded.positions[moment], recorded.headings[moment]])
        parts.append(element("p", f"at {recorded.time_s[moment]:.2f} s:"))
        parts.append(draw_arena(recorded.arena_at(moment), poses, population.radii_cm, recorded.ring_on[moment]))
    return to_html(*parts)


def show(file: Path | str) -> Any:
    """Show a recording, FILE.rrd, in rerun's viewer within a notebook, or a film, FILE.mp4, at the end of a cell.

    The viewer is interactive, and gone when the notebook's kernel has ended; a film becomes a part of the notebook.

    Raises:
        RecordingError: The file is no recording, or one of another version.
        EpuckSimError: There is no such file, it is of another kind, or Jupyter's parts are not installed.
    """
    path = Path(file)
    if not path.is_file():
        raise EpuckSimError(f"{path}: there is no such file")
    if path.suffix not in SHOWN:
        raise EpuckSimError(f"{path}: unknown format {path.suffix!r}; allowed: {', '.join(SHOWN)}")
    return SHOWN[path.suffix](path)


def _show_recording(path: Path) -> Any:
    import rerun as rr  # noqa: PLC0415 takes half a second
    from rerun import notebook  # noqa: PLC0415
    from rerun.chunk import RrdReader  # noqa: PLC0415

    from epuck_sim.recording.reader import read_layout  # noqa: PLC0415
    from epuck_sim.recording.rrd_file import APPLICATION  # noqa: PLC0415

    layout = read_layout(path)
    if not notebook.HAS_NOTEBOOK:
        raise EpuckSimError(NEEDED)
    reader = RrdReader(path)
    name = reader.recordings()[0].recording_id
    stream = rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False)
    viewer = notebook.Viewer(width=WIDTH_PX, height=HEIGHT_PX, recording=stream, blueprint=layout)
    rr.send_chunks(reader.store(), recording=stream)
    return viewer


def _show_film(path: Path) -> Any:
    try:
        from IPython.display import Video  # noqa: PLC0415 is there in notebooks
    except ModuleNotFoundError as error:
        raise EpuckSimError(NEEDED) from error
    return Video(str(path), embed=True)  # type: ignore[no-untyped-call]


SHOWN = {".rrd": _show_recording, ".mp4": _show_film}
"""What shows files, by the endings of their names."""
