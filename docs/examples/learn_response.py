"""Evolves a pulse response with which ten robots synchronise sooner than with the thesis's.

    python docs/examples/learn_response.py docs/figures/learning

writes learning.csv (the course of the evolution), learning.png (its curve, and what it learnt) and learning.txt (T_sync
with other responses and speeds, in trials that the evolution never saw). It takes some two minutes on two cores.
"""

import csv
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from epuck_sim import Simulation, TrialResult, load_scenario, run_trial
from epuck_sim.estimate import Estimate
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.comparison import Samples, compare
from epuck_sim.statistics.statistic import Measured, estimate_mean
from epuck_sim.util.seeds import trial_seed

CONTROLLER = Path(__file__).with_name("responsive_firefly.py")
PHASES = np.arange(1, 9) / 8  # phases, as shares of the period, at which a response is given; it is 0 at phase 0

STRONGEST = 0.1
"""Largest change of phase, either way, in periods: that of the thesis's response, at the end of the cycle."""

THESIS = STRONGEST * PHASES
SPEED_CM_S, PERIOD_S = 2.0, 5.0
LIMIT_PERIODS = 60  # periods after which a trial of the evolution ends, synchronised or not

NO_LIMIT_PERIODS = 1e6  # periods that no trial reaches: the thesis's limit of 10,000 cycles comes first

GENERATIONS = 14
CANDIDATES = 16
TRIALS = 16  # number of trials of each candidate in a generation; all candidates are tried with the same seeds

CHECKS = 32
"""Number of trials, always the same, that measure progress after each generation; no candidate is chosen by them."""

FIRST_SPREAD, SHRINKAGE = 0.04, 0.9
"""Standard deviation of the first candidates about their centre, in periods, and its factor in each generation."""

WEIGHTS = np.array([4, 3, 2, 1]) / 10  # share of each of the best candidates in the next centre

LEARNING, CHECKING, TESTING = range(1, 4)
"""Master seeds of trials that candidates are chosen by, that measure progress, and that are held out."""

TESTS = 200  # number of held-out trials at each point

Response = npt.NDArray[np.float64]


class Generation(NamedTuple):
    """What is known after a generation."""

    number: int
    trials: int  # trials up to now, without those that measure progress
    response: Response
    periods: Estimate  # time to synchrony with this response, in periods, limited to `LIMIT_PERIODS`


@cache
def swarm(speed_cm_s: float, limit_periods: float) -> Simulation:
    """Return the simulation of the thesis's base case in which all trials of a process take place."""
    settings = [
        f"robots.0.controller={CONTROLLER}",
        f"robots.0.parameters={{speed_cm_s: {speed_cm_s}, period_s: {PERIOD_S}}}",
        f"stop.max_time_s={PERIOD_S * limit_periods}",
    ]
    return Simulation(load_scenario("thesis", settings))


def synchronise(
    response: Response, seed: int, speed_cm_s: float = SPEED_CM_S, limit_periods: float = LIMIT_PERIODS
) -> TrialResult:
    """Run a trial with a response."""
    simulation = swarm(speed_cm_s, limit_periods)
    simulation.reset(seed)
    simulation.set_parameters(0, **{f"response_{node}": float(value) for node, value in enumerate(response, 1)})
    return run_trial(simulation)


def mean_periods(executor: Executor, responses: Response, seeds: list[int]) -> npt.NDArray[np.float64]:
    """Return (responses, seeds) periods until each trial ended."""
    pairs = [(response, seed) for response in responses for seed in seeds]
    results = executor.map(synchronise, *zip(*pairs, strict=True), chunksize=4)
    return np.reshape([result.simulated_s / PERIOD_S for result in results], (len(responses), len(seeds)))


def evolve(executor: Executor, generations: int = GENERATIONS) -> Iterator[Generation]:
    """Evolve the thesis's response by a strategy that recombines the best few of a normal cloud of candidates."""
    random = np.random.default_rng(LEARNING)
    checks = [trial_seed(CHECKING, trial) for trial in range(CHECKS)]
    centre, spread = THESIS, FIRST_SPREAD
    for number in range(generations + 1):
        if number:
            steps = random.normal(0.0, spread, (CANDIDATES // 2, len(PHASES)))
            candidates = np.clip(centre + np.concatenate([steps, -steps]), -STRONGEST, STRONGEST)
            seeds = [trial_seed(LEARNING, number * TRIALS + trial) for trial in range(TRIALS)]
            ranked = np.argsort(mean_periods(executor, candidates, seeds).mean(axis=1), kind="stable")
            centre = WEIGHTS @ candidates[ranked[: len(WEIGHTS)]]
            spread *= SHRINKAGE
        (periods,) = mean_periods(executor, centre[None], checks)
        measured = Measured(periods, periods < LIMIT_PERIODS, LIMIT_PERIODS, CHECKING)
        yield Generation(number, number * CANDIDATES * TRIALS, centre, estimate_mean(measured))


def held_out(executor: Executor, response: Response, speed_cm_s: float, trials: int) -> PointTrials:
    """Return T_sync of trials that the evolution never saw, with the thesis's limit of cycles."""
    seeds = [trial_seed(TESTING, trial) for trial in range(trials)]
    run = partial(synchronise, response, speed_cm_s=speed_cm_s, limit_periods=NO_LIMIT_PERIODS)
    results = list(executor.map(run, seeds))
    cycles = np.array([result.cycles for result in results], float)
    observed = np.array([not result.censored for result in results])
    return PointTrials(0, "", {}, swarm(speed_cm_s, NO_LIMIT_PERIODS).scenario, cycles, observed, tuple(seeds))


def table(executor: Executor, learnt: Response) -> Iterator[str]:
    """Compare responses with the thesis's, each line as it becomes known."""
    yield f"{'response':14}{'cm/s':>5}{'T_sync [cycles]':>24}{'thesis':>24}{'ratio':>24}{'p':>8}"
    sine = -STRONGEST * np.sin(2 * np.pi * PHASES)
    always = np.full(len(PHASES), STRONGEST)
    rows = [("learnt", learnt, speed) for speed in (1.0, SPEED_CM_S, 5.0)]
    rows += [("sine", sine, SPEED_CM_S), ("always ahead", always, SPEED_CM_S)]
    thesis = {}
    for name, response, speed in rows:
        if speed not in thesis:
            thesis[speed] = held_out(executor, THESIS, speed, TESTS)
        (comparison,) = compare(
            Samples(["thesis", name], [({}, [thesis[speed], held_out(executor, response, speed, TESTS)])])
        )
        (point,) = comparison.points
        shown = "".join(f"{estimate!s:>24}" for estimate in (point.second, point.first, point.ratio))
        yield f"{name:14}{speed:5g}{shown}{point.p_value:8.2g}"


def write(course: list[Generation], stem: Path) -> None:
    """Write the course of the evolution, and draw it beside the response that it found."""
    with stem.with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        nodes = [f"response_{node}" for node in range(1, len(PHASES) + 1)]
        writer.writerow(["generation", "trials", "periods", "low", "high", *nodes])
        for each in course:
            numbers = [f"{number:.4g}" for number in (*each.periods[:3], *each.response)]
            writer.writerow([each.number, each.trials, *numbers])
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    curve, shape = figure.subplots(1, 2)
    value, low, high = np.array([each.periods[:3] for each in course]).T
    trials = [each.trials for each in course]
    curve.fill_between(trials, low, high, color="0.85")
    curve.semilogy(trials, value, "o-", markersize=3, color="black")
    curve.set(xlabel="trials learnt from", ylabel="periods to synchrony")
    curve.set_yticks(ticks := [5, 10, 20, 40], labels=map(str, ticks))
    curve.minorticks_off()
    phases = [0.0, *PHASES]
    shape.axhline(0, color="0.85")
    shape.plot(phases, [0, *THESIS], "--", color="tab:red", label="thesis")
    shape.plot(phases, [0, *course[-1].response], "o-", markersize=3, color="black", label="learnt")
    shape.set(xlabel="phase at a flash [periods]", ylabel="change of phase [periods]")
    shape.legend()
    figure.savefig(stem.with_suffix(".png"), dpi=110)


def main(stem: Path) -> None:
    """Evolve, draw and compare."""
    with ProcessPoolExecutor() as executor:
        course = []
        for generation in evolve(executor):
            course.append(generation)
            print(generation.number, generation.periods, generation.response.round(3), flush=True)
        write(course, stem)
        lines = []
        for line in table(executor, course[-1].response):
            lines.append(line)
            print(line, flush=True)
    stem.with_suffix(".txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
