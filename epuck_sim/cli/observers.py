"""Observers of trials that the command opens: a trace, a recording, a film, a viewer."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from epuck_sim.cli.keys import pressed_keys
from epuck_sim.cli.progress import print_stderr
from epuck_sim.recording.level import Level
from epuck_sim.runs.share import Share
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import Scenario, require_model
from epuck_sim.trial.observer import Observer
from epuck_sim.util.atomic_write import check_trial_paths, trial_path

ObserverFactory = Callable[[int, int], AbstractContextManager[Observer]]
"""Opens an observer of a trial, from the trial's number and seed."""


class LiveView(NamedTuple):
    """How trials are shown while they run."""

    speed: float
    """Simulated seconds in a second."""
    port: int | None
    """Port of a viewer for browsers; None for a window."""


class RunOptions(NamedTuple):
    """Options of `epuck-sim run` that leave the outcome of trials as it is."""

    as_json: bool = False
    trace: Path | None = None
    record: Path | None = None
    live: LiveView | None = None
    film: Path | None = None
    level: Level = Level.FULL
    """How much is recorded, or shown while it runs."""
    interpret: bool = False
    """Whether controllers run as plain Python."""
    workers: int | None = None
    """Worker processes of a sweep; all cores if None."""
    dask: str | None = None
    """Address of the Dask scheduler that runs a sweep."""
    memory: tuple[str, ...] = ()
    """Fields of the controllers' MEMORY that traces, recordings and the live view have."""
    relations: bool = False
    """Whether traces list whom each robot sees lit, and whom it touches."""
    share: Share | None = None
    """Share of a sweep's trials to run; None for the whole, or for that of the folder."""
    """Whether stored trials survive a power cut."""


@contextmanager
def open_observers(options: RunOptions, scenario: Scenario, trials: int) -> Iterator[list[ObserverFactory]]:
    """Yield what opens the observers of each trial of a scenario; a viewer stays open until the user closes it.

    Raises:
        EpuckSimError: A file cannot be written, a viewer cannot be opened, or the model has nothing to look at.
    """
    factories: list[ObserverFactory] = []
    for target in (options.trace, options.record, options.film):
        if target is not None:
            check_trial_paths(target, trials)
    if options.trace is not None:
        from epuck_sim.trial.trace import Trace  # which needs pyarrow

        traced, trace = require_bodies(scenario), options.trace
        columns: dict[str, Any] = {"memory": options.memory, "relations": options.relations}
        factories.append(lambda trial, seed: Trace(trial_path(trace, trial, trials), traced, seed, **columns))
    if options.record is not None:
        from epuck_sim.recording.recorder import record  # rerun takes half a second
        from epuck_sim.recording.rrd_file import check_recording_target

        recording = options.record
        check_recording_target(trial_path(recording, 0, trials))
        factories.append(
            lambda trial, seed: record(
                trial_path(recording, trial, trials), scenario, seed, options.level, memory=options.memory
            )
        )
    if options.film is not None:
        from epuck_sim.overhead.filming import film_trial  # OpenCV and PyAV take a while

        filmed, film = require_bodies(scenario), options.film
        factories.append(lambda trial, seed: film_trial(trial_path(film, trial, trials), filmed, seed))
    if options.live is None:
        yield factories
        return
    from epuck_sim.recording.viewer.live import live, live_viewer
    from epuck_sim.recording.viewer.pace import sleep

    shown, speed = require_bodies(scenario), options.live.speed
    memory = tuple(dict.fromkeys(options.memory))
    with live_viewer(options.live.port, print_stderr) as (viewer, intake):
        with pressed_keys(echo=options.interpret) as wait:
            if wait is not None:
                print_stderr("space: pause, go on; n: one step; q: end")
            more: dict[str, Any] = {"memory": memory, "wait": wait or sleep}
            factories.append(lambda _, seed: live(viewer, intake, shown, seed, options.level, speed, **more))
            yield factories
        print_stderr("press Ctrl-C to end" if options.live.port else "close the viewer to end")
        with suppress(KeyboardInterrupt):
            viewer.wait()


def require_bodies(scenario: Scenario) -> EmbodiedScenario:
    """Return a scenario of robots with bodies; raise ScenarioError for another."""
    why = "--trace, --film and --live need model: embodied; --record FILE.rrd takes every model"
    return require_model(scenario, EmbodiedScenario, why)
