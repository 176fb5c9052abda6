"""Who looks on while trials run for the command line: a trace, a recording, a film, a viewer."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from epuck_sim.cli.progress import print_stderr
from epuck_sim.recording.level import Level
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import Scenario, require_model
from epuck_sim.trial.trace import Trace
from epuck_sim.util.atomic_write import trial_paths

ObserverFactory = Callable[[int, Scenario, int], AbstractContextManager[Callable[[Any, Any], None]]]
"""Gives an onlooker for a trial's number, scenario and seed, of the kind that the scenario's model has."""


class LiveView(NamedTuple):
    """How trials are shown while they run."""

    speed: float
    """Times as fast as real robots."""
    port: int | None
    """Of a viewer for browsers; a window is opened if it is None."""


class RunOptions(NamedTuple):
    """What is shown and kept of trials."""

    as_json: bool = False
    trace: Path | None = None
    record: Path | None = None
    live: LiveView | None = None
    film: Path | None = None
    level: Level = Level.FULL
    """Of what is recorded, or shown while it runs."""
    interpret: bool = False


@contextmanager
def open_observers(output: RunOptions, scenarios: Sequence[Scenario]) -> Iterator[list[ObserverFactory]]:
    """Yield those who are to look on at trials of these scenarios; a viewer stays open until the user closes it.

    Raises EpuckSimError where a file cannot be written, a viewer not be opened, or there is nothing to look at.
    """
    watchers: list[ObserverFactory] = []
    trials = len(scenarios)
    if output.trace is not None or output.live is not None or output.film is not None:
        for scenario in scenarios:
            require_embodied(scenario)
    if output.trace is not None:
        traces = trial_paths(output.trace, trials)
        watchers.append(lambda trial, scenario, seed: Trace(traces[trial], require_embodied(scenario), seed))
    if output.record is not None:
        from epuck_sim.recording.recorder import record
        from epuck_sim.recording.rrd_file import check_recording_target

        recordings = trial_paths(output.record, trials)
        check_recording_target(recordings[0])
        watchers.append(lambda trial, scenario, seed: record(recordings[trial], scenario, seed, output.level))
    if output.film is not None:
        from epuck_sim.overhead.render.film_trial import film_trial

        films = trial_paths(output.film, trials)
        watchers.append(lambda trial, scenario, seed: film_trial(films[trial], require_embodied(scenario), seed))
    if output.live is None:
        yield watchers
        return
    from epuck_sim.recording.viewer.live import live, live_viewer

    speed = output.live.speed
    with live_viewer(output.live.port, print_stderr) as (viewer, intake):
        watchers.append(
            lambda _, scenario, seed: live(viewer, intake, require_embodied(scenario), seed, output.level, speed)
        )
        yield watchers
        print_stderr("press Ctrl-C to end" if output.live.port else "close the viewer to end")
        with suppress(KeyboardInterrupt):
            viewer.wait()


def require_embodied(scenario: Scenario) -> EmbodiedScenario:
    """Return a scenario that is of robots with bodies; raises ScenarioError for another."""
    why = "--trace, --film and --live are for model: embodied; give --record FILE.rrd instead"
    return require_model(scenario, EmbodiedScenario, why)
