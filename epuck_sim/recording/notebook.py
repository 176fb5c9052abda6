"""Recordings and films in notebooks: in rerun's viewer, or at the end of a cell."""

from pathlib import Path
from typing import Any

from epuck_sim.errors import EpuckSimError

WIDTH_PX, HEIGHT_PX = 960, 600  # size of the viewer in a notebook

NEEDED = 'showing needs parts of Jupyter, which are not installed: pip install "epuck-sim[notebook]"'


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
    if path.suffix == ".rrd":
        return _show_recording(path)
    if path.suffix != ".mp4":
        raise EpuckSimError(f"{path}: unknown format {path.suffix!r}; allowed: .rrd, .mp4")
    try:
        from IPython.display import Video  # noqa: PLC0415 is there in notebooks
    except ModuleNotFoundError as error:
        raise EpuckSimError(NEEDED) from error
    return Video(str(path), embed=True)  # type: ignore[no-untyped-call]


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
