"""Films of trials in files: of one that is recorded, or of one while it runs."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.step import Step
from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.film.frame import Passing
from epuck_sim.overhead.film.writer import film_file
from epuck_sim.overhead.render.virtual_camera import Webcam
from epuck_sim.recording.level import Level
from epuck_sim.recording.reader import read_recording
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.overrides import apply_override
from epuck_sim.scenario.validation import validate
from epuck_sim.trial.synchrony import SynchronyWatch
from epuck_sim.util.provenance import versions

Taking = Callable[[float, FloatArray, BoolArray], None]
"""Takes the time of a control step, (robots, 3) poses and (robots,) whose ring is lit, as `Webcam.take` does."""


@contextmanager
def film_trial(path: Path, scenario: EmbodiedScenario, seed: int) -> Iterator[Callable[[Step, SynchronyWatch], None]]:
    """Yield an onlooker of a trial (see `run_trial`) that films it with the scenario's overhead camera.

    The film gets its name when the block ends; where it ends with an error, nothing is left behind.
    Raises EpuckSimError where the file cannot be written, or the camera cannot see the arena.
    """
    with _film(path, scenario, seed) as take:
        yield lambda step, _: take(step.time_s, step.poses, step.ring_on)


def film_recording(recording: Path, settings: Sequence[str], path: Path, passing: Passing) -> None:
    """Film a recorded trial with its scenario's overhead camera; settings: changes to that, as `--set` takes them.

    Raises EpuckSimError for a recording that cannot be filmed, a setting of something else than the camera, and where
    the film cannot be written.
    """
    recorded = read_recording(recording)
    if not isinstance(recorded.scenario, EmbodiedScenario):
        raise FilmError(
            f"{recording}: model is {recorded.scenario.model!r}, whose agents have no rings; allowed: 'embodied'"
        )
    if recorded.level is Level.SUMMARY:
        raise FilmError(f"{recording}: holds no poses; record the trial again with --record-level poses or full")
    given = recorded.scenario.model_dump(mode="json")
    for setting in settings:
        if not setting.startswith("overhead."):
            raise FilmError(f"--set {setting}: the trial is over; allowed: the camera's keys, as in overhead.light=lit")
        given = apply_override(given, setting)
    scenario = validate(given, str(recording))
    assert isinstance(scenario, EmbodiedScenario)  # as its model is no setting of the camera
    rows = zip(recorded.time_s, recorded.positions, recorded.headings, recorded.ring_on, strict=True)
    with _film(path, scenario, recorded.seed) as take:
        for time_s, positions, headings, ring_on in passing(rows, float(recorded.time_s.max(initial=0))):
            take(float(time_s), np.column_stack([positions, headings]), ring_on)


@contextmanager
def _film(path: Path, scenario: EmbodiedScenario, seed: int) -> Iterator[Taking]:
    section = scenario.overhead
    try:
        webcam = Webcam(section, scenario.arena.build(), seed)
    except EpuckSimError as error:
        raise FilmError(f"{scenario.name}: {error}") from error
    size = section.width_px, section.height_px
    with film_file(path, *size, describe_film(scenario, seed), scenario.name) as writer:

        def take(time_s: float, poses: FloatArray, ring_on: BoolArray) -> None:
            for frame in webcam.take(time_s, poses, ring_on):
                writer.write(frame)

        yield take
        for frame in webcam.end():
            writer.write(frame)


def describe_film(scenario: EmbodiedScenario, seed: int) -> dict[str, Any]:
    """Return what a film says of itself: how to make it again, and what `track` need not be told."""
    flashing = [group for group in scenario.robots if "period_s" in group.parameters]
    periods = {group.parameters["period_s"] for group in flashing}
    made_by = versions()
    return {
        "epuck_sim": made_by["epuck_sim"],
        "scenario": scenario.name,
        "seed": seed,
        "versions": made_by,
        "arena_cm": [scenario.arena.width_cm, scenario.arena.height_cm],
        "robots": sum(group.count for group in flashing) or None,
        "period_s": periods.pop() if len(periods) == 1 else None,
        "overhead": scenario.overhead.model_dump(),
    }
