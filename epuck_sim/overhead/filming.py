"""Films a recorded trial, or a trial while it runs, into a file, with a simulated webcam above the arena."""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.camera import Frame, Lens, Picture, ProgressWrapper, overhead_camera, read_lens
from epuck_sim.overhead.film import film_file
from epuck_sim.overhead.render import NO_MOVABLES, ExposureSample, Renderer
from epuck_sim.particles.simulation import Event, ParticleSimulation
from epuck_sim.recording import GREY, LIT, NIGHT, WHITE, Level
from epuck_sim.recording.rows import AgentBuffer, population_of
from epuck_sim.scenario.arena import OverheadSection
from epuck_sim.scenario.embodied import EmbodiedScenario, largest_cm
from epuck_sim.scenario.keys import full_keys, parse_setting, set_value
from epuck_sim.scenario.loader import load_of_model, validate
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.robot_kind import EPUCK, RobotKind
from epuck_sim.scenario.scenario import Scenario, ScenarioLike, require_model, seed_of_trial
from epuck_sim.trial.result import Observer
from epuck_sim.util.machine import lack_of_memory
from epuck_sim.util.provenance import versions

PIXEL_BYTES, FILM_BYTES = 110, 200_000_000
"""Memory of encoder and camera per pixel of a picture, and fixed memory; measured with 1 to 16 million pixels."""

SAMPLES = 4
"""Number of moments, evenly spread over an exposure, that are rendered into one picture.

A robot at 12.8 cm/s moves by less than the width of a ring from one to the next, in exposures of up to 90 ms.
"""

AGENTS_PX, AGENTS_MARGIN_PX = 720, 40  # side of pictures of agents, and their margin
SEGMENT_PX = 120  # height of pictures of a segment
AGENTS_FRAMES_PER_S = 25  # pictures of agents in a simulated second
DISC = (120, 126, 138)  # colour of an agent that has not just fired; darker in the viewer, for the agent's number

TIME_TOLERANCE_S = 1e-6  # times that differ by no more than this are taken as equal; the difference is rounding
HEIGHT_SHARE = 0.03  # height of a caption's capitals, relative to a picture's height, or to half its width if larger
CAPITAL_PX = 21  # height of capital letters at OpenCV's scale 1, in pixels


@dataclass(frozen=True)
class TrialFilm:
    """An observer that films a trial, and the trial's seed and scenario, see `run_trial`."""

    observe: Observer
    trial_seed: int
    trial_scenario: Scenario

    def __call__(self, event: Any, state: Any) -> None:
        """Film an event."""
        self.observe(event, state)


@contextmanager
def film_trial(path: Path | str, scenario: ScenarioLike, seed: int | None) -> Iterator[TrialFilm]:
    """Yield an observer for `run_trial` that films a trial with the overhead camera of its scenario while it runs.

    Filming does not change the trial. The film gets its name when the `with` block ends; if the block ends with an
    error, nothing is left behind.

    >>> scenario = load_scenario("thesis")  # doctest: +SKIP
    >>> with film_trial("trial.mp4", scenario, seed=1) as observer:  # doctest: +SKIP
    ...     result = run_trial(Simulation(scenario, seed=1), [observer])

    Point-like agents have no bodies that a camera could see: they are drawn as discs on the floor of their space, which
    is a line for a segment; for 0.075 of a period after they have fired, they are red.

    Args:
        path: The film, whose name ends in .mp4.
        scenario: Scenario of the trial, or what `load_scenario` takes.
        seed: The trial's seed, from which the camera's noise is drawn, too; None for the scenario's own.

    Raises:
        ScenarioError: The scenario is of another model, or the seed is not allowed.
        FilmError: Its camera cannot see the arena, its space is a cube, or the name does not end in .mp4.
        EpuckSimError: The file cannot be written.
    """
    scenario = load_of_model(scenario, Scenario)
    seed = seed_of_trial(scenario, seed)
    if isinstance(scenario, ParticleScenario):
        yield from _film_agents(Path(path), scenario, seed)
        return
    with _film(Path(path), _require_rings(scenario, scenario.name), seed) as observe:
        yield TrialFilm(
            lambda step, state: observe(
                state.cycles, state.order_parameter, step.time_s, step.poses, step.ring_on, step.movables, step.arena
            ),
            seed,
            scenario,
        )


def film_recording(
    recording: Path, overrides: Sequence[str], path: Path, progress: ProgressWrapper, lens: Path | None = None
) -> None:
    """Film a recorded trial with the overhead camera of its scenario, changed as by `--set`, through a lens in a file.

    EpuckSimError is raised if it cannot be filmed, an override is no camera key, or the film cannot be written.
    """
    from epuck_sim.recording.reader import read_recording  # noqa: PLC0415 takes rerun, which other films do without

    recorded, source = read_recording(recording), str(recording)
    mapping = _require_rings(recorded.scenario, source).model_dump(mode="json")
    if recorded.level is Level.SUMMARY:
        raise FilmError(f"{recording}: holds no poses; record the trial again with --record-level poses or full")
    keys = [f"overhead.{name}" for name in OverheadSection.model_fields]
    for override in overrides:
        option = f"--set {override}"
        typed, value = parse_setting(override)
        found = full_keys(typed, keys, option)
        if not found and not typed.startswith("overhead."):
            names = ", ".join(OverheadSection.model_fields)
            raise FilmError(f"{option}: is no key of the camera; the trial itself cannot change; allowed: {names}")
        mapping = set_value(mapping, (found or [typed])[0], value, option)
    scenario = _require_rings(validate(mapping, source), source)
    poses = map(np.column_stack, zip(recorded.positions, recorded.headings, strict=True))
    begin_s, arenas = zip(*recorded.arenas, strict=True)
    orders = [None, *recorded.firing_order.tolist()]
    cycles = np.searchsorted(recorded.firing_s, recorded.time_s, side="right")
    times_s = progress(recorded.time_s, float(recorded.time_s.max(initial=0)))
    moments = zip(times_s, cycles, poses, recorded.ring_on, recorded.movables, strict=True)
    with _film(path, scenario, recorded.seed, lens) as observe:
        for time_s, cycle, *robots in moments:
            arena = arenas[bisect_right(begin_s, time_s) - 1]
            observe(int(cycle), orders[cycle], float(time_s), *robots, arena)


def _require_rings(scenario: Scenario, origin: str) -> EmbodiedScenario:
    return require_model(scenario, EmbodiedScenario, "its agents have no rings; `run --film` films agents", origin)


@contextmanager
def _film(path: Path, scenario: EmbodiedScenario, seed: int, lens: Path | None = None) -> Iterator[Callable[..., None]]:
    """Yield a function that films a step from cycles, order parameter, and the arguments of `VirtualCamera.observe`."""
    section = scenario.overhead
    size = section.width_px, section.height_px
    if lack := lack_of_memory(FILM_BYTES + PIXEL_BYTES * size[0] * size[1]):
        raise FilmError(f"{scenario.name}: a film of {size[0]} x {size[1]} pixels {lack}; give fewer pixels")
    try:
        through = None if lens is None else read_lens(lens, size)
        arena = scenario.arena.build()
        camera = VirtualCamera(section, arena, seed, scenario.robot_kinds, through, largest_cm(scenario))
    except EpuckSimError as error:
        raise FilmError(f"{scenario.name}: {error}") from error
    described = describe_film(scenario, seed)
    if through is not None:
        described |= {"overhead": None, "lens": through._asdict()}
    with film_file(path, *size, described, scenario.name) as writer:
        captions = Captions(section.lit_start_s) if section.light == "lit" else None  # these films are for people

        def write(frames: Iterator[Frame]) -> None:
            for frame in frames:
                writer.write(captions.write(frame) if captions else frame)

        def observe(cycles: int, order_parameter: float | None, time_s: float, *robots: Any) -> None:
            if captions:
                captions.add(time_s, cycles, order_parameter)
            write(camera.observe(time_s, *robots))

        yield observe
        write(camera.finish())


def _film_agents(path: Path, scenario: ParticleScenario, seed: int) -> Iterator[TrialFilm]:
    """Yield an observer that films agents from above, as discs at their places in each picture."""
    population = population_of(scenario)
    if population.is_cube:
        said = "--film shows a floor, and its space has three dimensions; allowed: two or one"
        raise FilmError(f"{scenario.name}: {said}; --record and --live show it from above")
    side_cm, height_cm = population.largest_cm
    scale = (AGENTS_PX - 2 * AGENTS_MARGIN_PX) / side_cm
    height_px = AGENTS_PX if height_cm else SEGMENT_PX
    floor = np.full((height_px, AGENTS_PX, 3), NIGHT, np.uint8)
    top_px = AGENTS_MARGIN_PX if height_cm else SEGMENT_PX // 2
    corner = AGENTS_PX - AGENTS_MARGIN_PX, top_px + round(scale * height_cm)
    cv2.rectangle(floor, (AGENTS_MARGIN_PX, top_px), corner, GREY, 2)
    radius_px = round(scale * population.radii_cm[0])
    buffer = AgentBuffer(scenario, seed, Level.POSES, AGENTS_FRAMES_PER_S * scenario.clocks.period_s)
    captions, frames = Captions(0.0), 0
    last: ParticleSimulation | None = None

    def draw(poses: FloatArray, is_lit: BoolArray) -> Picture:
        picture = floor.copy()
        for (x_cm, y_cm, heading), lit in zip(poses, is_lit, strict=True):
            middle = AGENTS_MARGIN_PX + scale * x_cm, top_px + scale * (height_cm - y_cm)
            front = middle[0] + radius_px * math.cos(heading), middle[1] - radius_px * math.sin(heading)
            begin, end = ([round(16 * value) for value in place] for place in (middle, front))  # 1/16 pixel
            cv2.circle(picture, begin, 16 * radius_px, LIT if lit else DISC, -1, cv2.LINE_AA, shift=4)
            cv2.line(picture, begin, end, WHITE, 2, cv2.LINE_AA, shift=4)
        return picture

    with film_file(path, AGENTS_PX, height_px, _origin(scenario, seed), scenario.name) as writer:

        def write() -> None:
            nonlocal frames
            if not buffer.row_count:
                return
            rows = buffer.flush()
            for time_ns, poses, is_lit in zip(rows.time_ns.tolist(), rows.poses, rows.ring_on, strict=True):
                if abs(time_ns - frames * 1e9 / AGENTS_FRAMES_PER_S) < 2:  # not a row of an event
                    writer.write(captions.write(Frame(frames / AGENTS_FRAMES_PER_S, draw(poses, is_lit))))
                    frames += 1

        def observe(event: Event, state: ParticleSimulation) -> None:
            nonlocal last
            last = state
            captions.add(event.time_s, state.cycles, state.order_parameter)
            buffer.append(event, state)
            write()

        yield TrialFilm(observe, seed, scenario)
        if last is not None:
            buffer.end(last.time_s)
            write()


def _origin(scenario: Scenario, seed: int) -> dict[str, Any]:
    """Return the facts that are needed to make a film again."""
    return {"epuck_sim": versions()["epuck_sim"], "scenario": scenario.name, "seed": seed, "versions": versions()}


def describe_film(scenario: EmbodiedScenario, seed: int) -> dict[str, Any]:
    """Return the description stored in a film: how to make it again, and what `track` can read from it."""
    flashing = [group for group in scenario.robots if "period_s" in group.parameters]
    periods = {group.parameters["period_s"] for group in flashing}
    changes = any(entry.add or entry.remove for entry in scenario.schedule)
    return {
        **_origin(scenario, seed),
        "arena_cm": [*largest_cm(scenario)],
        "robots": None if changes else sum(group.count for group in flashing if group.present) or None,
        "period_s": periods.pop() if len(periods) == 1 else None,
        "overhead": scenario.overhead.model_dump(),
    }


class VirtualCamera:
    """Films a trial: frame k begins at k / frames_per_s; only the steps of one exposure are kept in memory.

    The film begins `lit_start_s` before the first step. Until the first step the room is lit, the robots stand where
    that step has them, and all rings are off.
    """

    def __init__(
        self,
        section: OverheadSection,
        arena: Arena,
        seed: int,
        kinds: Sequence[RobotKind] = (EPUCK,),
        lens: Lens | None = None,
        largest_cm: tuple[float, float] | None = None,
    ) -> None:
        """Place a camera above an arena, see `overhead_camera`, by default with the lens of the section.

        `seed` is the seed of the noise; `kinds` has one kind for each robot, or one for all. Where walls move, the
        camera sees the arena at its largest.
        """
        camera = overhead_camera(section, *(largest_cm or (arena.width_cm, arena.height_cm)))
        self._renderer = Renderer(section, camera._replace(lens=lens or camera.lens), arena, seed, kinds)
        self._section = section
        self._exposure_s = section.exposure_ms / 1000
        self._offset_s = 0.0  # film's clock minus trial's clock
        self._steps: deque[tuple[float, ExposureSample]] = deque()  # with their times on the film's clock
        self._frames = 0

    def observe(
        self,
        time_s: float,
        poses: FloatArray,
        ring_on: BoolArray,
        movables: FloatArray = NO_MOVABLES,
        arena: Arena | None = None,
    ) -> Iterator[Frame]:
        """Add the next control step, see `ExposureSample`; yield the frames whose exposures have ended by then.

        Robots, whose headings may be wrapped, and movables move evenly between steps; rings and arena change only at
        steps.
        """
        if not self._steps:
            self._offset_s = self._section.lit_start_s - time_s
        sample = ExposureSample(np.array(poses, float), np.array(ring_on, bool), np.array(movables, float), arena)
        now_s = self._offset_s + time_s
        self._steps.append((now_s, sample))
        return self._frames_begun_by(now_s - self._exposure_s)

    def finish(self) -> Iterator[Frame]:
        """Yield the frames that had begun by the last step, as if nothing changed until their exposures end."""
        return self._frames_begun_by(self._steps[-1][0] if self._steps else -math.inf)

    def _frames_begun_by(self, time_s: float) -> Iterator[Frame]:
        while (begin_s := self._frames / self._section.frames_per_s) <= time_s + TIME_TOLERANCE_S:
            self._frames += 1
            samples = [self._sample(begin_s + (part + 0.5) / SAMPLES * self._exposure_s) for part in range(SAMPLES)]
            is_lit = self._section.light == "lit" or begin_s < self._section.lit_start_s - TIME_TOLERANCE_S
            yield Frame(begin_s, colours=self._renderer.render(samples, room_is_lit=is_lit))
            next_s = self._frames / self._section.frames_per_s
            while len(self._steps) > 1 and self._steps[1][0] <= next_s:
                self._steps.popleft()

    def _sample(self, time_s: float) -> ExposureSample:
        """Return the robots at a moment of the film, interpolated between the steps around it."""
        begun = bisect_right(self._steps, time_s + TIME_TOLERANCE_S, key=lambda step: step[0])
        last_s, last = self._steps[max(begun - 1, 0)]
        if begun == 0:
            return last._replace(ring_on=np.zeros_like(last.ring_on))
        if begun == len(self._steps):
            return last
        next_s, following = self._steps[begun]
        share = (time_s - last_s) / (next_s - last_s)
        change = following.poses - last.poses
        change[:, 2] = (change[:, 2] + math.pi) % math.tau - math.pi  # the shorter way round
        pushed = last.movables + share * (following.movables - last.movables)
        return last._replace(poses=last.poses + share * change, movables=pushed)


class Captions:
    """Writes into each frame the state of the trial when its exposure began."""

    def __init__(self, start_s: float) -> None:
        """Begin the trial's clock at `start_s`, the time on the film's clock when robots start."""
        self._start_s = start_s
        self._states: deque[tuple[float, int, float | None]] = deque([(0.0, 0, None)])

    def add(self, time_s: float, cycles: int, order_parameter: float | None) -> None:
        """Add the state of the trial from `time_s` on; times rise."""
        self._states.append((time_s, cycles, order_parameter))

    def write(self, frame: Frame) -> Frame:
        """Return a frame with its caption, whose letters have an edge; frames come in the order of their times."""
        time_s = max(0.0, frame.time_s - self._start_s)
        while len(self._states) > 1 and self._states[1][0] <= time_s + TIME_TOLERANCE_S:
            self._states.popleft()
        _, cycles, order = self._states[0]
        more = "" if order is None else f"   cycle {cycles}   order parameter {order:.2f}"
        text, picture = f"{time_s:.1f} s{more}", frame.picture.copy()
        letter_px = HEIGHT_SHARE * max(len(picture), picture.shape[1] / 2)
        left, base, edge_px = round(letter_px / 2), round(1.6 * letter_px), max(1, round(letter_px / 8))
        around = [(x, y) for x in (-edge_px, 0, edge_px) for y in (-edge_px, 0, edge_px) if x or y]
        for x, y in (*around, (0, 0)):  # thicker letters would also be wider
            colour = (0, 0, 0) if x or y else (255, 255, 255)
            scale = letter_px / CAPITAL_PX
            cv2.putText(picture, text, (left + x, base + y), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
        return Frame(frame.time_s, picture)
