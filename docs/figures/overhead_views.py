"""Makes docs/figures/overhead_views.png, overhead_track.png and .csv: a film, and what its tracker finds in it.

`make figures` runs it; it takes a minute.
"""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.figures.films import save_track_figure
from epuck_sim.overhead.annotate import Annotator
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import Picture
from epuck_sim.overhead.film import open_film
from epuck_sim.overhead.filming import film_trial
from epuck_sim.overhead.flashes import RingCounter
from epuck_sim.overhead.track import look_again, track_film, track_frames

OUT = Path(__file__).parent
SCENARIO = "thesis"
SEED = 13
FURTHER = "stop.further_cycles=20"
AT_S = 98.9  # when six of the robots are lit


def film(path: Path, *settings: str) -> None:
    """Film the trial."""
    scenario = load_scenario(SCENARIO, [FURTHER, *settings])
    with film_trial(path, scenario, SEED) as observer:
        run_trial(Simulation(scenario, SEED), [observer])


def picture_at(path: Path) -> Picture:
    """Return the film's picture at `AT_S`."""
    with open_film(str(path)) as opened:
        return next(frame.picture for frame in opened.frames() if frame.time_s >= AT_S)


def main() -> None:
    """Make all."""
    with tempfile.TemporaryDirectory() as folder:
        dark, lit = Path(folder) / "dark.mp4", Path(folder) / "lit.mp4"
        film(dark)
        film(lit, "overhead.light=lit")
        track = track_film(str(dark), TrackOptions(), None, lambda frames, _: frames)
        save_track_figure(OUT / "overhead_track.png", track, look_again(track, None, lambda frames, _: frames))
        with open_film(str(dark)) as opened:
            annotator = Annotator(opened.width_px, opened.height_px, track.period_s)
            counter = RingCounter(track.geometry)
            for tracked in track_frames(opened.frames(), counter, track.period_s, track.options):
                annotated = annotator.annotate(tracked)
                if tracked.frame.time_s >= AT_S:
                    break
        pictures = {"in the light": picture_at(lit), "as the webcam saw it": picture_at(dark), "tracked": annotated}
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    for panel, (title, picture) in zip(figure.subplots(1, 3), pictures.items(), strict=True):
        panel.imshow(np.asarray(picture))
        panel.set_title(title)
        panel.axis("off")
    figure.savefig(OUT / "overhead_views.png", dpi=110)


if __name__ == "__main__":
    main()
