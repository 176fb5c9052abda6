"""Makes docs/figures/overhead_detection.csv, overhead_agreement.csv and .png: how far to trust the tracker of films.

Detection: 100 trials in each of four conditions are filmed into H.264 for 10 s and tracked; rings are compared with
where the simulation has them. Agreement: 100 trials at ten speeds are filmed until the film itself shows synchrony, and
its T_sync is compared with that of the trial, r >= 0.95 at a firing of the reference. `make figures` runs it; it takes
about half an hour on two cores. With a number as its argument it runs that many trials, for a quick look.
"""

import csv
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial, reduce
from itertools import islice
from operator import add
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import Simulation, load_scenario
from epuck_sim.overhead.camera_model import overhead_camera
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.film.reader import open_film
from epuck_sim.overhead.render.film_trial import film_trial
from epuck_sim.overhead.render.virtual_camera import VirtualCamera
from epuck_sim.overhead.track.geometry import Geometry
from epuck_sim.overhead.track.period_estimation import estimate_flash_s, spread_at_s, spread_threshold_s
from epuck_sim.overhead.track.ring_counter import RingCounter
from epuck_sim.overhead.track.ring_detection import RingFinder
from epuck_sim.overhead.track.spread import SynchronyDetector, first_synchronised, is_synchronised
from epuck_sim.trial.synchrony import SynchronyWatch
from epuck_sim.util.seeds import trial_seed
from tests.overhead.score import Score, compare

OUT = Path(__file__).parent
TRIALS = 100
MASTER_SEED = 0
SPEEDS_CM_S = (0.5, 0.7, 1.0, 1.4, 2.1, 3.0, 4.3, 6.2, 8.9, 12.8)
"""Speeds of the physical experiments."""

CLEAN = [f"overhead.{key}=0" for key in ("noise_levels", "blur_px", "bloom", "vignetting", "distortion")]
HARSH = ["noise_levels=8", "blur_px=1.5", "bloom=0.3", "vignetting=0.5", "distortion=-0.1"]
LONG_FLASHES = ["robots.0.parameters.refractory_fraction=0.5", "robots.0.parameters.flash_fraction=0.5"]
CONDITIONS = {
    "clean": CLEAN,
    "default": [],
    "crowded": ["arena.width_cm=36", "arena.height_cm=36", *LONG_FLASHES],
    "harsh": [f"overhead.{setting}" for setting in HARSH],
}
FILM_S = 10.0

LATEST_CYCLES = 100
"""Number of cycles for which a film may continue after its trial is synchronised."""

CRITERIA = ("2 frames", "Appendix C", "r of 0.95")
PERIOD_S = 5.0


def detect(settings: list[str], trial: int) -> Score:
    """Return how well the rings of a trial's film are found."""
    speed = f"robots.0.parameters.speed_cm_s={SPEEDS_CM_S[trial % len(SPEEDS_CM_S)]}"
    scenario = load_scenario("thesis", [*settings, speed])
    steps = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        simulation = Simulation(scenario, trial_seed(MASTER_SEED, trial))
        watch = SynchronyWatch(simulation)
        with film_trial(path, scenario, simulation.seed) as film:
            for step in islice(simulation, round(FILM_S / simulation.step_s)):
                film(step, watch)
                steps.append((step.time_s, step.poses[:, :2].copy(), step.ring_on.copy()))
        finder = RingFinder(overhead_camera(scenario.overhead, scenario.arena.width_cm, scenario.arena.height_cm))
        exposure_s = scenario.overhead.exposure_ms / 1000
        with open_film(str(path)) as film:
            scores = [score(finder, frame, steps, exposure_s) for frame in film.frames()]
    return reduce(add, scores)


def score(finder: RingFinder, frame: Frame, steps: list, exposure_s: float) -> Score:
    """Return how well the rings in a frame are found; the truth is their place in the middle of the exposure."""
    times_s = np.array([time_s for time_s, *_ in steps])
    first, last = (np.searchsorted(times_s, frame.time_s + end_s + 1e-5) - 1 for end_s in (0, exposure_s - 2e-5))
    on = np.array([ring_on for *_, ring_on in steps[first : last + 1]])
    middle_s = frame.time_s + exposure_s / 2
    now = np.searchsorted(times_s, middle_s) - 1
    following = min(now + 1, len(steps) - 1)
    share = (middle_s - times_s[now]) * 10 if following > now else 0.0
    places = steps[now][1] + share * (steps[following][1] - steps[now][1])
    found = np.array([ring[:2] for ring in finder.find(frame.picture)]).reshape(-1, 2)
    return compare(found, places[on.all(axis=0)], places[on.any(axis=0) & ~on.all(axis=0)])


def frames_of(simulation: Simulation, watch: SynchronyWatch) -> Iterator[Frame]:
    """Yield the frames of a film of a simulation that never ends."""
    scenario = simulation.scenario
    camera = VirtualCamera(scenario.overhead, scenario.arena.build(), simulation.seed)
    for step in simulation:
        watch.look(step)
        yield from camera.observe(step.time_s, step.poses, step.ring_on)


def agree(trial: int) -> list[float]:
    """Return a trial's speed, seed and T_sync, and T_sync of its film by each criterion in periods and in flashes."""
    speed = SPEEDS_CM_S[trial % len(SPEEDS_CM_S)]
    scenario = load_scenario("thesis", [f"robots.0.parameters.speed_cm_s={speed}"])
    simulation = Simulation(scenario, trial_seed(MASTER_SEED, trial))
    watch = SynchronyWatch(simulation)
    floor_cm = scenario.arena.width_cm, scenario.arena.height_cm
    camera = overhead_camera(scenario.overhead, *floor_cm)
    counter = RingCounter(Geometry(camera, floor_cm, "the scenario", True))
    detector = SynchronyDetector(PERIOD_S, 0.0)
    evaluations = []
    t_sync = None
    for frame in frames_of(simulation, watch):
        evaluation = detector.update(frame.time_s, len(counter.process(frame)))
        if t_sync is None and watch.is_synchronised:
            t_sync = watch.cycles
        if evaluation is not None:
            evaluations.append(evaluation)
            is_over = is_synchronised(evaluation, 0.125) or (t_sync and watch.cycles > t_sync + LATEST_CYCLES)
            if t_sync is not None and is_over:
                break
    times_s, counts = counter.times_s, counter.counts
    flash_s = estimate_flash_s(times_s, counts)
    thresholds_s = (2 / 15.5, spread_threshold_s(PERIOD_S, flash_s), spread_at_s(PERIOD_S, flash_s))
    row = [speed, simulation.seed, t_sync]
    for threshold_s in thresholds_s:
        at_s = first_synchronised(evaluations, threshold_s)
        if at_s is None:
            row += [np.nan, np.nan]
        else:
            lit = counts[times_s <= at_s + PERIOD_S / 4].sum() / scenario.overhead.frames_per_s
            row += [at_s / PERIOD_S, lit / flash_s / scenario.robot_count]
    return row


def write(name: str, header: list[str], rows: list) -> None:
    """Write a table."""
    with (OUT / name).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in row] for row in rows)


def draw(rows: np.ndarray) -> None:
    """Draw T_sync of films against T_sync of trials."""
    figure = Figure(figsize=(11, 4), layout="constrained")
    for panel, name, column in zip(figure.subplots(1, 3, sharex=True, sharey=True), CRITERIA, (4, 6, 8), strict=True):
        panel.loglog(rows[:, 2], rows[:, column], "o", color="tab:red", alpha=0.6, markersize=4)
        panel.loglog([3, 300], [3, 300], color="0.6")
        panel.set(title=f"spread at most that of {name}", xlabel="trial: firings until r >= 0.95")
    figure.axes[0].set(ylabel="film: flashes of each robot until T_sync")
    figure.savefig(OUT / "overhead_agreement.png", dpi=110)


def report(rows: np.ndarray) -> Iterator[list]:
    """Yield how much later the film is synchronised than the trial, for each criterion and way to count cycles."""
    for place, name in enumerate(CRITERIA):
        for offset, unit in enumerate(("periods", "flashes")):
            later = rows[:, 3 + 2 * place + offset] - rows[:, 2]
            known = later[~np.isnan(later)]
            spread = np.percentile(known, [5, 25, 50, 75, 95])
            yield [name, unit, len(known), len(later), float(known.mean()), *map(float, spread)]


if __name__ == "__main__":
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else TRIALS
    with ProcessPoolExecutor() as executor:
        table = []
        for condition, settings in CONDITIONS.items():
            total = reduce(add, executor.map(partial(detect, settings), range(trials)))
            lit = total.found + total.missed
            percent = 100 * total.recall, 100 * total.precision
            error_mm = 10 * total.rms_cm, 10 * total.worst_cm
            table.append([condition, lit, total.missed, total.false, *percent, *error_mm])
            print(table[-1], flush=True)
        header = ["condition", "rings", "missed", "false", "recall_percent", "precision_percent", "rms_mm", "worst_mm"]
        write("overhead_detection.csv", header, table)
        outcomes = list(executor.map(agree, range(trials)))
    columns = [f"{name.replace(' ', '_')}_{unit}" for name in CRITERIA for unit in ("periods", "flashes")]
    write("overhead_trials.csv", ["speed_cm_s", "seed", "t_sync_cycles", *columns], outcomes)
    array = np.array(outcomes, float)
    summary = list(report(array))
    header = ["criterion", "unit", "synchronised", "trials", "mean_later", "p5", "p25", "median", "p75", "p95"]
    write("overhead_agreement.csv", header, summary)
    for line in summary:
        print(line)
    draw(array)
