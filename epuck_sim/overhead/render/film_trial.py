"""Films trials into files: a recorded trial, or one while it runs."""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.camera_model import overhead_camera
from epuck_sim.overhead.film.frame import ProgressWrapper
from epuck_sim.overhead.film.writer import film_file
from epuck_sim.overhead.lens_file import read_lens
from epuck_sim.overhead.render.caption import Captions
from epuck_sim.overhead.render.virtual_camera import VirtualCamera
from epuck_sim.recording.level import Level
from epuck_sim.recording.parts import population_of
from epuck_sim.recording.reader import read_recording
from epuck_sim.recording.recorded import Recorded
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.overrides import apply_override
from epuck_sim.scenario.scenario import Scenario, require_model
from epuck_sim.scenario.validation import validate
from epuck_sim.trial.observer import Observer
from epuck_sim.util.memory import lack_of_memory
from epuck_sim.util.provenance import versions

PIXEL_BYTES, FILM_BYTES = 110, 200_000_000
"""Memory of encoder and camera for each pixel of a picture, and besides, as measured with 1 to 16 million pixels."""

_State = tuple[int, float | None]
"""Cycles of the reference so far, and the order parameter at its last firing; None before the first."""


@contextmanager
def film_trial(path: Path | str, scenario: Scenario, seed: int) -> Iterator[Observer]:
    """Film a trial with the overhead camera of its scenario while it runs.

    Filming does not change the trial. The film gets its name when the `with` block ends; if the block ends with an
    error, nothing is left behind.

    >>> scenario = load_scenario("thesis")  # doctest: +SKIP
    >>> with film_trial("trial.mp4", scenario, seed=1) as observer:  # doctest: +SKIP
    ...     result = run_trial(Simulation(scenario, seed=1), [observer])

    Args:
        path: The film, whose name ends in .mp4.
        scenario: Scenario of the trial, as `load_scenario` returns it; its model must be `embodied`.
        seed: Seed of the trial; the camera's noise is drawn from it, too.

    Yields:
        An observer for `run_trial`.

    Raises:
        ScenarioError: The scenario is of another model.
        FilmError: Its camera cannot see the arena, or the name does not end in .mp4.
        EpuckSimError: The file cannot be written.
    """
    with _film(Path(path), _require_rings(scenario, scenario.name), seed) as observe:
        yield lambda step, state: observe(
            *(step.time_s, step.poses, step.ring_on, step.movables, step.arena), (state.cycles, state.order_parameter)
        )


def film_recording(
    recording: Path, overrides: Sequence[str], path: Path, progress: ProgressWrapper, lens: Path | None = None
) -> None:
    """Film a recorded trial with the overhead camera of its scenario.

    Args:
        recording: The recording (.rrd) of an embodied trial, of any level but `summary`.
        overrides: Changes to the camera, each `overhead.KEY=VALUE` as `--set` takes it.
        path: The film, whose name ends in .mp4.
        progress: Shows how far the film is.
        lens: The file of a lens through which it is filmed.

    Raises:
        EpuckSimError: The recording cannot be filmed, an override is not of the camera, or the film cannot be written.
    """
    recorded = read_recording(recording)
    recorded_scenario = _require_rings(recorded.scenario, str(recording))
    if recorded.level is Level.SUMMARY:
        raise FilmError(f"{recording}: holds no poses; record the trial again with --record-level poses or full")
    scenario = _override_camera(recorded_scenario, overrides, str(recording))
    arrays = recorded.time_s, recorded.positions, recorded.headings, recorded.ring_on, recorded.movables
    begin_s, arenas = zip(*recorded.arenas, strict=True)
    moments = zip(*arrays, _states(recorded), strict=True)
    with _film(path, scenario, recorded.seed, lens) as observe:
        for time_s, positions, headings, ring_on, places, state in progress(
            moments, float(recorded.time_s.max(initial=0))
        ):
            arena = arenas[bisect_right(begin_s, time_s) - 1]
            observe(float(time_s), np.column_stack([positions, headings]), ring_on, places, arena, state)


def _states(recorded: Recorded) -> Iterator[_State]:
    """Yield the cycles and the order parameter of each row, as the trial had them."""
    reference_flashes = recorded.flash_s[recorded.flash_robot == population_of(recorded.scenario).reference]
    cycles = np.searchsorted(reference_flashes, recorded.time_s, side="right")
    measured = np.searchsorted(recorded.firing_s, recorded.time_s, side="right")
    for cycle, count in zip(cycles.tolist(), measured.tolist(), strict=True):
        yield cycle, float(recorded.firing_order[count - 1]) if count else None


def _require_rings(scenario: Scenario, origin: str) -> EmbodiedScenario:
    return require_model(scenario, EmbodiedScenario, "its agents have no rings; allowed: 'embodied'", origin)


def _override_camera(scenario: EmbodiedScenario, overrides: Sequence[str], source: str) -> EmbodiedScenario:
    """Return a scenario with changes to its overhead camera; source: file to name in errors."""
    mapping = scenario.model_dump(mode="json")
    for override in overrides:
        if not override.startswith("overhead."):
            raise FilmError(
                f"--set {override}: the trial is over; allowed: the camera's keys, as in overhead.light=lit"
            )
        mapping = apply_override(mapping, override)
    return _require_rings(validate(mapping, source), source)


@contextmanager
def _film(
    path: Path, scenario: EmbodiedScenario, seed: int, lens: Path | None = None
) -> Iterator[Callable[[float, FloatArray, BoolArray, FloatArray, Arena, _State], None]]:
    """Yield a function that films a control step.

    It takes the time, (robots, 3) poses, rings that are on, (movables, 2) cm, the arena, and the state.

    Films of a lit room, which are for people, have a caption.
    """
    section = scenario.overhead
    size = section.width_px, section.height_px
    if lack := lack_of_memory(FILM_BYTES + PIXEL_BYTES * size[0] * size[1]):
        raise FilmError(f"{scenario.name}: a film of {size[0]} x {size[1]} pixels {lack}; give fewer pixels")
    try:
        model = overhead_camera(section, scenario.arena.width_cm, scenario.arena.height_cm)
        if lens is not None:
            model = model._replace(lens=read_lens(lens, size))
        camera = VirtualCamera(section, scenario.arena.build(), seed, scenario.robot, model)
    except EpuckSimError as error:
        raise FilmError(f"{scenario.name}: {error}") from error
    described = describe_film(scenario, seed) | ({} if lens is None else {"overhead": None})
    with film_file(path, *size, described, scenario.name) as writer:
        captions = Captions(section.lit_start_s)
        finished = captions.write if section.light == "lit" else lambda frame: frame

        def observe(
            time_s: float, poses: FloatArray, ring_on: BoolArray, movables: FloatArray, arena: Arena, state: _State
        ) -> None:
            captions.add(time_s, *state)
            for frame in camera.observe(time_s, poses, ring_on, movables, arena):
                writer.write(finished(frame))

        yield observe
        for frame in camera.finish():
            writer.write(finished(frame))


def describe_film(scenario: EmbodiedScenario, seed: int) -> dict[str, Any]:
    """Return the description stored in a film: how to make it again, and what `track` can read from it."""
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
