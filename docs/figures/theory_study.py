"""Judges `epuck_sim.theory` by trials of random scenarios.

`theory_study.py trials SET FILE` appends a line of JSON a scenario to FILE, and goes on where it stopped. The set `fit`
has 60 scenarios. As it turned out to have seven with an intermediate regime, too few to fix thresholds on, `more` was
drawn, whose first 70 were added to it. `blind` has 200 others, which judge. The seed of each set stood here before its
trials were run. `limits` runs further trials of `blind` that stand, and that are fast.

`theory_study.py judge FOLDER` reads blind.jsonl and limits.jsonl, and writes theory-blind.csv and theory.txt.
`theory_study.py draw FOLDER` draws the figures; the folder is that of the sweep `two-nearest` in its quick version.
"""

import csv
import json
import math
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import read_points
from epuck_sim.arrays import FloatArray
from epuck_sim.display.table import csv_text
from epuck_sim.figures.style import choose_looks
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics.statistic import wilson_interval
from epuck_sim.theory.predict import predict, predict_points, without_speed
from epuck_sim.trial.model import run_trial

SETS = {"fit": (60, 1990), "more": (140, 1975), "blind": (200, 2018)}  # number of scenarios and seed of each
BINS = (0.0, 0.1, 0.3, 0.7, 0.9, 1.01)  # ends of the classes of probabilities
OUT = Path(__file__).parent / "theory"
BLIND = OUT.with_name("theory-blind.csv")
BLUE, GREY = "#0072b2", "#bbbbbb"

SIDE_CM = 100.0
SPEEDS_CM_S = [round(0.03 * (80 / 0.03) ** (place / 11), 3) for place in range(12)]
FAST_CM_S = 370.0
"""Far beyond the fast regime, and no whole number of sides in a cycle, which takes agents of a cyclic space back."""
TRIALS, MAX_CYCLES = 12, 2000

SPACES = [(2, "bounded")] * 6 + [(2, "cyclic")] * 5 + [(3, "bounded")] * 3 + [(3, "cyclic")] * 2
SPACES += [(2, "mirrored")] * 2 + [(1, "bounded")] * 2
CURVES = ["multiplicative"] * 4 + ["additive", "mirollo_strogatz", "sawtooth", "sine"]


def draw_scenarios(name: str) -> Iterator[dict[str, Any]]:
    """Yield the scenarios of a set: space, neighbourhood, number, coupling and curve, each drawn by itself."""
    count, seed = SETS[name]
    random = np.random.default_rng(seed)
    for number in range(count):
        dimensions, boundary = SPACES[random.integers(len(SPACES))]
        agents = round(math.exp(random.uniform(math.log(5), math.log(40))))
        kind = ["nearest", "range", "cone_of_vision", "cone_of_emission"][random.choice(4, p=[0.3, 0.2, 0.25, 0.25])]
        hood: dict[str, Any] = {"kind": kind}
        links = math.exp(random.uniform(math.log(0.7), math.log(6)))
        angle, reach = random.uniform(30, 150), math.exp(random.uniform(math.log(20), math.log(150)))
        if kind == "nearest":
            hood["k"] = min(int(random.integers(1, 5)), agents - 1)
        elif kind == "range":
            unit_ball = {1: 2.0, 2: math.pi, 3: 4 / 3 * math.pi}[dimensions]
            hood["radius_cm"] = round(SIDE_CM * (links / (agents - 1) / unit_ball) ** (1 / dimensions), 1)
        else:
            hood |= {"angle_deg": round(angle), "radius_cm": round(reach, 1)}
        yield {
            "name": f"{name}-{number}",
            "model": "particles",
            "space": {"dimensions": dimensions, "side_cm": SIDE_CM, "boundary": boundary},
            "agents": {"count": agents},
            "neighbourhood": hood,
            "response": {
                "curve": CURVES[random.integers(len(CURVES))],
                "coupling": round(math.exp(random.uniform(math.log(0.03), math.log(0.3))), 3),
            },
            "stop": {"max_cycles": MAX_CYCLES},
        }


def at_speed(given: dict[str, Any], speed_cm_s: float) -> Scenario:
    """Return a scenario of a set at a speed."""
    return load_scenario({**given, "agents": {**given["agents"], "speed_cm_s": speed_cm_s}})


def run_trials(given: dict[str, Any], speeds_cm_s: Sequence[float], seeds: range) -> list[list[int | None]]:
    """Return T_sync of each trial at each speed, in cycles; None where it is censored."""
    found = []
    for speed in speeds_cm_s:
        simulation, times = ParticleSimulation(at_speed(given, speed), 0), []
        for seed in seeds:
            simulation.reset(seed)
            times.append(run_trial(simulation).t_sync_cycles)
        found.append(times)
    return found


def extend(name: str, file: Path) -> None:
    """Append the trials of a set's scenarios to a file, from the first that is not there."""
    done = len(file.read_text().splitlines()) if file.exists() else 0
    at_limits = name == "limits"
    speeds = [0.0, FAST_CM_S] if at_limits else [0.0, *SPEEDS_CM_S, FAST_CM_S]
    seeds = range(TRIALS, 3 * TRIALS) if at_limits else range(TRIALS)
    for number, given in enumerate(draw_scenarios("blind" if at_limits else name)):
        if number >= done:
            line = json.dumps({"scenario": given, "times": run_trials(given, speeds, seeds)})
            with file.open("a") as opened:
                opened.write(line + "\n")


class Truth(NamedTuple):
    """What the trials of a scenario say."""

    verdict: str
    """`yes`: T_sync rises by more than a tenth (basic bootstrap, 95 %); `no`: by less than 1.6 (percentiles), and
    at most half of the speeds have mostly censored trials; else `open`."""
    rise: float
    v_m: float
    v_p: float


def rise_of(logs: FloatArray) -> tuple[float, int, int]:
    """Return the largest rise of ln T_sync, (speeds, trials), smoothed over three speeds, and from where to where."""
    mean = logs.mean(1)
    mean[1:-1] = (mean[:-2] + 2 * mean[1:-1] + mean[2:]) / 4
    above = mean - np.minimum.accumulate(mean)
    peak = int(above.argmax())
    return float(above[peak]), int(mean[: peak + 1].argmin()), peak


def decide(times: list[list[int | None]]) -> Truth:
    """Return what trials say; censored ones count as if they had ended then."""
    logs = np.log([[time or MAX_CYCLES for time in row] for row in times[1:-1]])
    censored = np.array([[time is None for time in row] for row in times[1:-1]]).mean(1)
    random, (rise, low, peak) = np.random.default_rng(0), rise_of(logs)
    drawn = (np.take_along_axis(logs, random.integers(TRIALS, size=logs.shape), 1) for _ in range(300))
    most = np.percentile([rise_of(each)[0] for each in drawn], 97.5)
    verdict = "open"
    if 2 * rise - most > math.log(1.1):
        verdict = "yes"
    elif most < math.log(1.6) and (censored > 0.5).sum() <= len(censored) / 2:
        verdict = "no"
    return Truth(verdict, math.exp(rise), SPEEDS_CM_S[low], SPEEDS_CM_S[peak])


def mean_of(times: list[int | None]) -> float:
    """Return the mean of the times that are known; NaN of fewer than ten."""
    known = [time for time in times if time is not None]
    return float(np.mean(known)) if len(known) >= 10 else math.nan


def read(file: Path) -> list[dict[str, Any]]:
    """Return the lines of a file of trials."""
    return [json.loads(line) for line in file.read_text().splitlines()]


COLUMNS = ["scenario", "space", "neighbourhood", "agents", "response", "trials", "rise", "predicted", "probability"]
COLUMNS += ["v_p", "v_p_predicted", "t_fast", "t_fast_predicted", "t_frozen", "t_frozen_predicted"]


def judge(folder: Path) -> None:
    """Predict the scenarios of `blind`, and write what trials say beside it: theory-blind.csv."""
    more = {line["scenario"]["name"]: line["times"] for line in read(folder / "limits.jsonl")}
    rows = []
    for line in read(folder / "blind.jsonl"):
        given, times = line["scenario"], line["times"]
        found, truth = predict(at_speed(given, 1.0)), decide(times)
        stand, fast = more.get(given["name"], ([], []))
        stands, fasts = mean_of(times[0] + stand), mean_of(times[-1] + fast)
        if None in times[-1] + fast:
            fasts = math.nan
        numbers = (found.v_p_cm_s, found.t_sync_fast, found.t_sync_frozen)
        hood = " ".join(str(value) for value in given["neighbourhood"].values())
        space = f"{given['space']['dimensions']} {given['space']['boundary']}"
        response = f"{given['response']['curve']} {given['response']['coupling']}"
        row = [given["name"], space, hood, given["agents"]["count"], response, truth.verdict, f"{truth.rise:.3g}"]
        row += [found.intermediate_regime.verdict, f"{found.intermediate_regime.probability:.3f}"]
        v_p, t_fast, t_frozen = (f"{number.value:.4g}" for number in numbers)
        rows.append([*row, truth.v_p, v_p, f"{fasts:.4g}", t_fast, f"{stands:.4g}", t_frozen])
        BLIND.write_text(csv_text(COLUMNS, rows))


def judged() -> list[dict[str, str]]:
    """Return the rows of theory-blind.csv."""
    return list(csv.DictReader(BLIND.read_text().splitlines()))


def pairs_of(rows: list[dict[str, str]], name: str, of: str) -> list[tuple[float, float]]:
    """Return what trials say of a number and what was predicted, where they have a regime, or everywhere."""
    return [(float(row[name]), float(row[f"{name}_predicted"])) for row in rows if row["trials"].startswith(of)]


def summarize() -> None:
    """Write theory.txt from theory-blind.csv: confusion, calibration, and how many places and times are near."""
    rows, verdicts = judged(), ("yes", "open", "no")
    lines = [f"{len(rows)} scenarios; rows: trials, columns: predicted yes, open, no"]
    counts = Counter((row["trials"], row["predicted"]) for row in rows)
    lines += [f"{truth}: {[counts[truth, each] for each in verdicts]}" for truth in verdicts]
    decided = [row for row in rows if row["trials"] != "open"]
    right = [row for row in decided if (float(row["probability"]) >= 0.5) == (row["trials"] == "yes")]
    lines.append(f"right of those that trials decide, by a probability of 0.5: {len(right)} of {len(decided)}")
    closed = [row for row in decided if row["predicted"] != "open"]
    count = sum(row["predicted"] == row["trials"] for row in closed)
    lines.append(f"right of those that trials decide and that are not predicted open: {count} of {len(closed)}")
    for low, high in pairwise(BINS):
        inside = [row["trials"] == "yes" for row in decided if low <= float(row["probability"]) < high]
        lines.append(f"probability {low:g} to {high:g}: {sum(inside)} of {len(inside)} have a regime")
    for name, limit, of in (("v_p", 2.0, "yes"), ("t_fast", 1.2, ""), ("t_frozen", 1.2, "")):
        known = [(one, other) for one, other in pairs_of(rows, name, of) if one > 0 and other > 0]
        near = sum(max(one / other, other / one) <= limit for one, other in known)
        lines.append(f"{name} within a factor of {limit}: {near} of {len(known)}")
    wrong = (row for row in closed if row["predicted"] != row["trials"])
    lines += ["wrong: " + ", ".join(row[key] for key in COLUMNS[:9]) for row in wrong]
    OUT.with_suffix(".txt").write_text("\n".join(lines) + "\n")


def draw_order() -> None:
    """Draw the neighbourhoods of the sweep `neighbour-change` in the order of their probability of a regime."""
    lines = OUT.with_name("neighbour-change.csv").read_text().splitlines()
    names = list(dict.fromkeys(row["curve"] for row in csv.DictReader(lines)))
    told = OUT.with_name("neighbour-change.txt").read_text()
    no_peak = told.partition("no peak: ")[2].partition("\n")[0].split("; ")
    found = {
        str(without_speed(point.scenario)): each for point, each in predict_points(load_scenario("neighbour-change"))
    }
    rows = sorted(zip(names, found.values(), strict=True), key=lambda row: row[1].intermediate_regime.probability)
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    for place, (name, each) in enumerate(rows):
        colour = GREY if name in no_peak and "segment" not in name else BLUE
        axes.barh(place, each.intermediate_regime.probability, color=colour)
        share = each.graph.sources.value / each.graph.links.value
        axes.text(1.02, place, f"{share:.2f}", va="center", fontsize="small")
    for colour, label in ((BLUE, "trials have a peak, or most are censored in it"), (GREY, "trials have none")):
        axes.barh(0, 0, color=colour, label=label)
    axes.set(yticks=range(len(rows)), xlim=(0, 1.12), xlabel="predicted probability of an intermediate regime")
    axes.set_yticklabels([name for name, _ in rows], fontsize="small")
    axes.set_title("right: share that is heard but hears nobody, over links an agent", fontsize="small", loc="right")
    axes.legend(loc="lower right", bbox_to_anchor=(0.9, 0.05), fontsize="small")
    figure.savefig(OUT.with_name("theory-order.png"), dpi=130)


def draw_two_nearest(folder: Path) -> None:
    """Draw T_sync of pulses to the two nearest agents, and its prediction dashed."""
    figure = Figure(figsize=(7, 4.2), layout="constrained")
    axes = figure.subplots()
    found, predicted = read_points(folder), predict_points(load_scenario("two-nearest"))
    for count, look in zip((10, 20, 40), choose_looks(3), strict=True):
        trials = [point for point in found if point.axes["agents.count"] == count]
        speeds = [point.axes["agents.speed_cm_s"] for point in trials]
        medians = [np.median(point.times) for point in trials]
        axes.loglog(speeds, medians, look.marker, color=look.colour, label=f"N = {count}")
        courses = [each for point, each in predicted if point.axes["agents.count"] == count]
        axes.loglog(speeds, [each.t_sync.value for each in courses], "--", color=look.colour, linewidth=1)
    axes.axhline(3000, color=GREY, linewidth=0.8)
    axes.text(7, 3200, "trials are censored here", fontsize="small", color="#666666")
    axes.set(xlabel="V (cm/s)", ylabel="T_sync (cycles)", ylim=(8, 3e4))
    axes.legend(title="median of 10 trials;\ndashed: predicted", fontsize="small", title_fontsize="small")
    figure.savefig(OUT.with_name("two-nearest.png"), dpi=130)


def draw_blind() -> None:
    """Draw predictions beside trials, of the 200 scenarios that judge."""
    rows = judged()
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    decided = [(float(row["probability"]), row["trials"] == "yes") for row in rows if row["trials"] != "open"]
    for low, high in pairwise(BINS):
        inside = np.array([each for each in decided if low <= each[0] < high])
        mean, share = inside.mean(0)
        left.plot([mean, mean], wilson_interval(float(share), len(inside)), color=BLUE, linewidth=1)
        left.plot(mean, share, "o", color=BLUE)
        left.annotate(f"{len(inside)}", (mean, share), xytext=(5, -9), textcoords="offset points", fontsize="small")
    left.plot([0, 1], [0, 1], color=GREY, linewidth=0.8)
    left.set(xlabel="predicted probability of a regime", ylabel="share whose trials have one")
    numbers = (
        ("v_p", middle, "o", "yes", ""),
        ("t_fast", right, "o", "", "fast"),
        ("t_frozen", right, "^", "", "standing"),
    )
    for name, axes, marker, of, label in numbers:
        axes.loglog(*zip(*pairs_of(rows, name, of), strict=True), marker, markersize=3.5, alpha=0.6, label=label)
    panels = (middle, (0.05, 100.0), 2.0, "V_p (cm/s)"), (right, (2.0, 2000.0), 1.2, "T_sync (cycles)")
    for axes, ends, near, label in panels:
        for factor, style in ((1 / near, ":"), (1, "-"), (near, ":")):
            axes.plot(ends, [factor * end for end in ends], color=GREY, linewidth=0.8, linestyle=style)
        axes.set(xlabel=f"{label}, trials", ylabel=f"{label}, predicted")
    right.legend(fontsize="small")
    figure.savefig(OUT.with_name("theory-blind.png"), dpi=130)


if __name__ == "__main__":
    if sys.argv[1] == "trials":
        extend(sys.argv[2], Path(sys.argv[3]))
    elif sys.argv[1] == "judge":
        judge(Path(sys.argv[2]))
        summarize()
    else:
        draw_order()
        draw_two_nearest(Path(sys.argv[2]))
        draw_blind()
