"""Observers of trials that the command opens: a trace, a recording, a film, a viewer."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from epuck_sim.cli.errors import print_stderr
from epuck_sim.recording import Level
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


class Watched(NamedTuple):
    """What is written or shown of trials."""

    trace: Path | None = None
    record: Path | None = None
    film: Path | None = None
    live: LiveView | None = None
    level: Level = Level.FULL
    """How much is recorded, or shown while it runs."""
    memory: tuple[str, ...] = ()
    """Fields of the controllers' MEMORY that traces, recordings and the live view have."""
    relations: bool = False
    """Whether traces list whom each robot sees lit, and whom it touches."""


@contextmanager
def open_observers(
    watched: Watched, scenario: Scenario, trials: int, *, echo: bool = False
) -> Iterator[list[ObserverFactory]]:
    """Yield what opens the observers of each trial of a scenario; a viewer stays open until the user closes it.

    Args:
        watched: What is written or shown.
        scenario: The scenario.
        trials: Number of trials.
        echo: Whether keys that are pressed are shown, as a debugger needs it.

    Raises:
        EpuckSimError: A file cannot be written, a viewer cannot be opened, or the model has nothing to look at.
    """
    factories: list[ObserverFactory] = []
    for target in (watched.trace, watched.record, watched.film):
        if target is not None:
            check_trial_paths(target, trials)
    if watched.trace is not None:
        from epuck_sim.trial.trace import Trace  # which needs pyarrow

        traced, trace = require_bodies(scenario), watched.trace
        columns: dict[str, Any] = {"memory": watched.memory, "relations": watched.relations}
        factories.append(lambda trial, seed: Trace(trial_path(trace, trial, trials), traced, seed, **columns))
    if watched.record is not None:
        factories.append(_recorder(watched, watched.record, scenario, trials))
    if watched.film is not None:
        from epuck_sim.overhead.filming import film_trial  # OpenCV and PyAV take a while

        film = watched.film
        factories.append(lambda trial, seed: film_trial(trial_path(film, trial, trials), scenario, seed))
    if watched.live is None:
        yield factories
    else:
        with _viewer(watched, watched.live, scenario, echo) as factory:
            yield [*factories, factory]


def _recorder(watched: Watched, path: Path, scenario: Scenario, trials: int) -> ObserverFactory:
    from epuck_sim.recording.recorder import record
    from epuck_sim.recording.rrd_file import check_recording_target

    check_recording_target(trial_path(path, 0, trials))
    level, memory = watched.level, watched.memory
    return lambda trial, seed: record(trial_path(path, trial, trials), scenario, seed, level, memory=memory)


@contextmanager
def _viewer(watched: Watched, view: LiveView, scenario: Scenario, echo: bool) -> Iterator[ObserverFactory]:
    from epuck_sim.cli.keys import pressed_keys
    from epuck_sim.recording.live import live, live_viewer, sleep

    memory, level = tuple(dict.fromkeys(watched.memory)), watched.level
    with live_viewer(view.port, _invite) as (viewer, intake):
        with pressed_keys(echo=echo) as wait:
            if wait is not None:
                print_stderr("space: pause, go on; n: one step; q: end")
            more: dict[str, Any] = {"memory": memory, "wait": wait or sleep}
            yield lambda _, seed: live(viewer, intake, scenario, seed, level, view.speed, **more)
        print_stderr("press Ctrl-C to end" if view.port else "close the viewer to end")
        with suppress(KeyboardInterrupt):
            viewer.wait()


def _invite(address: str) -> None:
    print_stderr(f"open this address in a browser on this machine; the trial begins by itself:\n{address}")


def require_bodies(scenario: Scenario) -> EmbodiedScenario:
    """Return a scenario of robots with bodies; raise ScenarioError for another."""
    why = "--trace needs model: embodied; --record FILE.rrd, --film and --live take every model"
    return require_model(scenario, EmbodiedScenario, why)
