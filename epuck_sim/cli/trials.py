"""The work of `epuck-sim run`: some trials at once, one trial of a sweep again, or a sweep into its run folder."""

import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import typer

from epuck_sim.cli.errors import note_if_slow, prefix_scenario, print_stderr
from epuck_sim.cli.options import read_scenario
from epuck_sim.cli.progress import SweepProgressBar, TrialProgress
from epuck_sim.cli.tables import print_json, print_status, print_trials
from epuck_sim.cli.terminal import pressed_keys
from epuck_sim.errors import ScenarioError
from epuck_sim.recording import Level
from epuck_sim.runs.compatibility import Share
from epuck_sim.runs.folder import DATABASE
from epuck_sim.runs.reader import read_outcome, read_status
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import RUN_SCENARIO, Point, points
from epuck_sim.scenario.scenario import Scenario, require_model
from epuck_sim.trial.model import check_interpretable, run_trial, simulate
from epuck_sim.trial.result import Observer, TrialResult
from epuck_sim.util.atomic_write import check_trial_paths, trial_path
from epuck_sim.util.messages import counted
from epuck_sim.util.provenance import format_versions, versions
from epuck_sim.util.seeds import trial_seed

LARGE = 1000  # least population of a trial that takes long to set up even if everything is compiled

ObserverFactory = Callable[[int, int], AbstractContextManager[Observer]]
"""Opens an observer of a trial, from the trial's number and seed."""


class Watched(NamedTuple):
    """Files that are written of trials, and views of them."""

    trace: Path | None = None
    record: Path | None = None
    film: Path | None = None
    live: bool = False  # whether trials are shown while they run
    level: Level = Level.FULL  # how much is recorded, or shown while it runs
    memory: tuple[str, ...] = ()  # fields of the controllers' MEMORY that traces, recordings and the live view have
    relations: bool = False  # whether traces list whom each robot sees lit, and whom it touches
    speed: float = 1.0  # simulated seconds in a second, where trials are shown
    port: int | None = None  # port of a viewer for browsers; None for a window

    @property
    def files(self) -> list[Path]:
        """Files that are written; see `trial_path` for their names if there are several trials."""
        return [each for each in (self.trace, self.record, self.film) if each is not None]


@contextmanager
def open_observers(
    watched: Watched, scenario: Scenario, trials: int, *, echo: bool = False
) -> Iterator[list[ObserverFactory]]:
    """Yield functions that open the observers of each trial; a viewer stays open until the user closes it."""
    factories: list[ObserverFactory] = []
    memory, level = watched.memory, watched.level
    for target in watched.files:
        check_trial_paths(target, trials)
    if (trace := watched.trace) is not None:
        from epuck_sim.trial.trace import Trace  # which needs pyarrow

        why = "--trace needs model: embodied; --record FILE.rrd, --film and --live take every model"
        bodies = require_model(scenario, EmbodiedScenario, why)
        columns: dict[str, Any] = {"memory": memory, "relations": watched.relations}
        factories.append(lambda trial, seed: Trace(trial_path(trace, trial, trials), bodies, seed, **columns))
    if (recording := watched.record) is not None:
        from epuck_sim.recording.recorder import record
        from epuck_sim.recording.rerun import check_recording_target

        check_recording_target(trial_path(recording, 0, trials))
        factories.append(
            lambda trial, seed: record(trial_path(recording, trial, trials), scenario, seed, level, memory=memory)
        )
    if (film := watched.film) is not None:
        from epuck_sim.overhead.filming import film_trial  # OpenCV and PyAV take a while

        factories.append(lambda trial, seed: film_trial(trial_path(film, trial, trials), scenario, seed))
    with ExitStack() as stack:
        if watched.live:
            factories.append(stack.enter_context(_viewer(watched, scenario, echo)))
        yield factories


@contextmanager
def _viewer(watched: Watched, scenario: Scenario, echo: bool) -> Iterator[ObserverFactory]:
    from epuck_sim.recording.rows import population_of
    from epuck_sim.recording.series import recorded_fields
    from epuck_sim.recording.viewer import live, live_viewer, sleep

    level, memory = watched.level, recorded_fields(scenario, watched.level, watched.memory)
    population_of(scenario)  # raises, before a viewer opens, if nothing can be shown
    invitation = "open this address in a browser on this machine; the trial begins by itself:\n"
    with live_viewer(watched.port, lambda address: print_stderr(invitation + address)) as (viewer, intake):
        with pressed_keys(echo=echo) as wait:
            if wait is not None:
                print_stderr("space: pause, go on; n: one step; q: end")
            more: dict[str, Any] = {"memory": memory, "wait": wait or sleep}
            yield lambda _, seed: live(viewer, intake, scenario, seed, level, watched.speed, **more)
        print_stderr("press Ctrl-C to end" if watched.port else "close the viewer to end")
        with suppress(KeyboardInterrupt):
            viewer.wait()


def chosen_trials(origin: str, scenario: Scenario, point: int | None, trial: int | None) -> tuple[Scenario, list[int]]:
    """Return the scenario and the seeds of its trials, or those of the trial of a sweep that must be chosen."""
    if point is None or trial is None:
        if scenario.sweep is not None:
            advice = "give --out FOLDER to run it, or --point K --trial J to run one of its trials"
            raise ScenarioError(f"{origin}: holds a sweep of {counted(len(points(scenario)), 'point')}; {advice}")
        return scenario, [trial_seed(scenario.seed, number) for number in range(scenario.trials)]
    all_points = points(scenario)
    if point >= len(all_points):
        raise ScenarioError(f"{origin}: --point is {point}; allowed: 0 to {len(all_points) - 1}")
    chosen = all_points[point]
    if trial >= chosen.scenario.trials:
        raise ScenarioError(f"{origin}: --trial is {trial}; allowed: 0 to {chosen.scenario.trials - 1}")
    return chosen.scenario, [chosen.seed(trial)]


def run_trials(
    origin: str,
    scenario: Scenario,
    seeds: Sequence[int],
    watched: Watched,
    *,
    interpret: bool = False,
    as_json: bool = False,
) -> list[TrialResult]:
    """Run trials one after the other, print them, and return their results."""
    if interpret:
        check_interpretable(scenario)
    results: list[TrialResult] = []
    with open_observers(watched, scenario, len(seeds), echo=interpret) as factories:
        try:
            with TrialProgress(len(seeds), scenario.stop, interpret=interpret) as progress, prefix_scenario(origin):
                for trial, seed in enumerate(seeds):
                    results.append(_run_trial(scenario, seed, trial, factories, progress, interpret, watched))
                    if as_json:
                        print_json(results[-1])
        finally:
            if not as_json:
                print_trials(results, scenario.stop.max_cycles)
                for target, trial in product(watched.files, range(len(results))):
                    typer.echo(bytes(trial_path(target, trial, len(seeds))))  # its name may be no text
    return results


def _run_trial(
    scenario: Scenario,
    seed: int,
    trial: int,
    factories: Sequence[ObserverFactory],
    progress: TrialProgress,
    interpret: bool,
    watched: Watched,
) -> TrialResult:
    """Run one trial; its simulation is gone when this returns, as Ctrl-C may be lost while pymunk frees a space."""
    with ExitStack() as stack:
        observers = [stack.enter_context(factory(trial, seed)) for factory in factories]
        setting_up = f"setting up a trial with a population of {scenario.population:,}"
        with note_if_slow(setting_up) if scenario.population >= LARGE else nullcontext():
            simulation = simulate(scenario, seed, interpret=interpret)
        if watched.live and isinstance(scenario, EmbodiedScenario):
            from epuck_sim.embodied.changes.replacement import ControllerFiles  # numba takes a while
            from epuck_sim.embodied.simulation import Simulation

            assert isinstance(simulation, Simulation), "its scenario has bodies"
            observers.append(ControllerFiles(simulation, print_stderr))
        # interpreted code may stand at a breakpoint
        progress.begin(trial, None if interpret else getattr(simulation, "at_work", None))
        return run_trial(simulation, observers, progress)


def record_again(folder: Path, point: int, trial: int, file: Path, *, interpret: bool, trusted: bool = False) -> None:
    """Simulate a trial of a run folder again, record it, and say so if its outcome differs from the stored one."""
    stored = read_outcome(folder, point, trial)
    chosen, seeds = chosen_trials(str(folder), read_scenario(folder / RUN_SCENARIO, trusted=trusted), point, trial)
    (result,) = run_trials(str(folder), chosen, seeds, Watched(record=file), interpret=interpret)
    if stored is not None and stored != (result.cycles, result.censored):
        made = "; ".join(format_versions(row.made_by) for row in read_status(folder).versions)
        said = f"note: this trial differs from the stored one, which lasted {stored[0]} cycles"
        which = f"the folder was made by {made}, this is {format_versions(versions())}"
        print_stderr(f"{said}; its controller or the versions may have changed: {which}")


def sweep_into(
    origin: str,
    scenario: Scenario,
    folder: Path,
    workers: int | None,
    dask: str | None,
    share: str | None,
    until: str | None,
    contrast: str | None,
    *,
    interpret: bool,
    as_json: bool,
) -> None:
    """Run a sweep into its folder, print how far it is, and end with exit code 1 if trials have failed."""
    from epuck_sim.sweep.cluster import DaskCluster
    from epuck_sim.sweep.demand import check_memory, describe_size
    from epuck_sim.sweep.run import run_sweep
    from epuck_sim.sweep.scheduler import available_cores

    _note_other_versions(folder)
    given = {"--workers": workers, "--dask": dask, "--until": until, "--contrast": contrast}
    words = [word for name, value in given.items() if value is not None for word in (name, str(value))]
    again = shlex.join(["epuck-sim", "run", f"{folder}/", *words, *["--interpret"] * interpret])
    pool = workers if dask is None else DaskCluster(dask).open
    looks = None
    if until is not None:
        from epuck_sim.sweep.looks import Looks  # which takes scipy

        looks = Looks(until, contrast)
    of_share = Share.parse(share) if share else None
    with SweepProgressBar() as bar, prefix_scenario(origin):
        try:
            with note_if_slow(f"checking every point of {scenario.name}") as over:

                def begin(found: Sequence[Point]) -> None:
                    over()
                    if callable(pool):
                        with pool():  # check that it answers before there is a folder
                            pass
                    else:
                        check_memory(found, pool or available_cores())
                    most = "" if looks is None else ", at most"
                    print_stderr(f"{found[0].scenario.name}: {describe_size(found)}{most}")
                    bar.points = found

                run_sweep(scenario, folder, pool, bar, interpret=interpret, share=of_share, until=looks, begin=begin)
        except KeyboardInterrupt:
            if not (folder / DATABASE).exists():
                said = "stopped before the first trial; nothing was written"
            elif bar.progress and (trials := bar.progress.trials):  # its own count may lack one that was just stored
                said = f"stopped; {read_status(folder).stored} of {trials} trials are stored; go on with: {again}"
            else:
                said = f"stopped; nothing is lost; go on with: {again}"
            print_stderr(said)
            raise typer.Exit(130) from None
    status = read_status(folder)
    print_status(status, as_json, None if looks is None else looks.table())
    if status.failed:
        failed = counted(len(status.failed), "trial")
        said = f"{failed} failed; run again to retry them: {again}"
        if any(" measure" in failure.error for failure in status.failed):
            said += f"; a measure may be mended, or left out, first: {folder / RUN_SCENARIO} has its file"
        print_stderr(said)
        raise typer.Exit(1)


def _note_other_versions(folder: Path) -> None:
    if (folder / DATABASE).exists():
        for row in read_status(folder).versions:
            if {**row.made_by, **versions()} != row.made_by:
                said = f"note: {row.trials} trials were made by {format_versions(row.made_by)}"
                print_stderr(f"{said}; this is {format_versions(versions())}: last digits may differ")
