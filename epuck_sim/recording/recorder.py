"""Records a trial: an onlooker that gathers steps in a window and turns full windows into chunks of a recording."""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from pathlib import Path

import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.embodied import EmbodiedScenario
from epuck_sim.errors import ScenarioError
from epuck_sim.provenance import versions
from epuck_sim.recording.chunks import still, strictly
from epuck_sim.recording.layout import layout_file
from epuck_sim.recording.level import Level
from epuck_sim.recording.pictures import SpaceTime, pictures, set_pictures
from epuck_sim.recording.rrd_file import rrd_file
from epuck_sim.recording.scene import make_stage, scene, set_scene, warm_up
from epuck_sim.recording.series import series, series_styles
from epuck_sim.recording.window import Columns, Window
from epuck_sim.scenario import Scenario
from epuck_sim.scenario_file import load_scenario, write_scenario
from epuck_sim.step import Step
from epuck_sim.synchrony import SynchronyWatch

FORMAT = 1
"""Of the entities in a recording; a newer one may have others."""

WINDOW_S = 600
"""Simulated time in memory before it is written."""

WINDOW_ROWS = 60_000
"""But no more rows, one a robot and step, than these: about 8 MB."""

TRIAL = "trial"
OUTCOME = "outcome"
"""Properties of a recording."""


@contextmanager
def record(path: Path, scenario: Scenario, seed: int, level: Level = Level.FULL) -> Iterator["Recorder"]:
    """Yield an onlooker of a trial (see `trial.run_trial`) that records it into a file for the rerun viewer.

    The file gets its name when the block ends; where it ends with an error, nothing is left behind.
    Raises EpuckSimError where the file cannot be written.
    """
    scenario = load_scenario(scenario)  # with every default written out
    if not isinstance(scenario, EmbodiedScenario):
        raise ScenarioError(f"{scenario.name}: model: {scenario.model} cannot be recorded yet")
    layout = layout_file(level, scenario.arena.width_cm, scenario.arena.height_cm)
    with rrd_file(path, recording_id(scenario, seed, level), layout) as write:
        recorder = Recorder(scenario, seed, level, WINDOW_S, write)
        yield recorder
        recorder.finish()


class Recorder:
    """An onlooker that hands on chunks, window by window."""

    def __init__(
        self,
        scenario: EmbodiedScenario,
        seed: int,
        level: Level,
        window_s: float,
        write: Callable[[Iterable[Chunk]], None],
    ) -> None:
        """Write what does not move; nothing of a trial needs to exist yet.

        window_s: the most of simulated time that is held back.
        """
        steps = max(1, int(min(window_s * scenario.timing.control_hz, WINDOW_ROWS / scenario.robot_count)))
        self._send = write
        self._window = Window(scenario, level, steps)
        self._watch: SynchronyWatch | None = None
        self._rest: Callable[[], Iterable[Chunk]] = tuple  # what views hold back until the end
        self._write(_description(scenario, seed, level))
        self._write(series_styles(scenario, level))
        self._views: list[Callable[[Columns], Iterable[Chunk]]] = [
            partial(series, threshold=scenario.stop.order_parameter, level=level)
        ]
        if level is not Level.SUMMARY:
            stage = make_stage(scenario)
            self._write(set_scene(stage, scenario.robot_count, level))
            self._views.append(partial(scene, stage=stage, level=level))
        if level is Level.FULL:
            warm_up(stage)
            space_time = SpaceTime(scenario)
            self._write(set_pictures(scenario))
            self._views += [pictures, space_time.pictures]
            self._rest = space_time.rest

    def __call__(self, step: Step, watch: SynchronyWatch) -> None:
        """Take note of a step."""
        self._watch = watch
        self._window.take(step, watch)
        if self._window.is_full:
            self._empty_window(watch)

    def _empty_window(self, watch: SynchronyWatch) -> None:
        columns = self._window.empty(watch)
        for view in self._views:
            self._write(view(columns))

    def _write(self, chunks: Iterable[Chunk]) -> None:
        with strictly():
            self._send(chunks)

    def finish(self) -> None:
        """Write what is left, and how the trial ended."""
        cycles, synchronised = 0, False
        if self._watch is not None:
            cycles, synchronised = self._watch.cycles, self._watch.is_synchronised
            if self._window.taken:
                self._empty_window(self._watch)
        self._write(self._rest())
        self._write([Chunk.from_property(OUTCOME, rr.AnyValues(cycles=cycles, synchronised=synchronised))])


def recording_id(scenario: EmbodiedScenario, seed: int, level: Level) -> str:
    """Return a name that is the same whenever the same trial is recorded at the same level."""
    described = f"{write_scenario(scenario)}\n{seed}\n{level}\n{json.dumps(versions())}"
    return hashlib.sha256(described.encode()).hexdigest()[:32]


def _description(scenario: EmbodiedScenario, seed: int, level: Level) -> Iterator[Chunk]:
    made_by = {**versions(), "rerun": version("rerun-sdk")}
    trial = rr.AnyValues(
        format=FORMAT,
        level=str(level),
        scenario=write_scenario(scenario),
        seed=str(seed),  # which may exceed 64 bits
        versions=json.dumps(made_by),
    )
    yield Chunk.from_property(TRIAL, trial)
    yield still("/__properties", rr.archetypes.RecordingInfo(name=f"{scenario.name}, seed {seed}"))
