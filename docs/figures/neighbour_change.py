"""Draws T_sync over speed and over the rate of neighbour change: `neighbour_change.py RUN_FOLDER`.

The folder is that of the sweep `neighbour-change`. Writes neighbour-change.png, the curves as neighbour-change.csv, and
how well they collapse as neighbour-change.txt.
"""

import csv
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import read_points
from epuck_sim.arrays import FloatArray
from epuck_sim.estimate import Estimate
from epuck_sim.figures.style import choose_looks
from epuck_sim.replication.criteria import Effect, collapse, exponentiate, find_place, resampled
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import require_model
from epuck_sim.statistics.curves import Curve, estimate_curve, group_by_other_axes
from epuck_sim.statistics.extrema import Place

SPEED = "agents.speed_cm_s"
SPACES = {(2, "cyclic"): ", cyclic", (1, "bounded"): ", segment", (3, "bounded"): ", cube"}
AT_RATE = 0.15
"""Rate of neighbour change at which T_sync is compared, near that of the peaks."""
OUT = Path(__file__).parent / "neighbour-change"


class Line(NamedTuple):
    """A neighbourhood in a space."""

    name: str
    times: Curve
    """T_sync over speed, cycles."""
    rates: Curve
    """Share of links that change from a cycle to the next, over speed."""
    dimensions: int
    """Number of dimensions of the space."""
    peak: Place | None
    """Speed at the peak of T_sync, cm/s."""

    def rate_at_peak(self) -> Place:
        """Return the rate of neighbour change at the peak, interpolated."""
        assert self.peak is not None
        x, rows = np.log(self.times.x), np.log(self.rates.resampled)
        value = np.exp(np.interp(np.log(self.peak.estimate.value), x, np.log(self.rates.values)))
        places = zip(np.log(self.peak.resampled), rows, strict=True)
        return Place(Estimate(float(value)), np.array([np.exp(np.interp(at, x, row)) for at, row in places]))

    def time_at(self, rate: float) -> float:
        """Return T_sync at a rate of neighbour change, interpolated."""
        return float(np.exp(np.interp(np.log(rate), np.log(self.rates.values), np.log(self.times.values))))


def mean_of_cycles(point: PointTrials) -> PointTrials:
    """Return a point whose trials have the mean over their cycles instead of a series."""
    measured: Any = point.measured
    known = [[value for value in series if value is not None] for series in measured]
    return point._replace(measured=tuple(float(np.mean(values)) if values else None for values in known))


def read_lines(folder: Path) -> list[Line]:
    """Return the lines of a run folder, in the order of the sweep."""
    lines = []
    for axes, group in group_by_other_axes(read_points(folder, of="neighbour_change"), SPEED):
        times = estimate_curve([point._replace(of=None) for point in group], SPEED, axes)
        rates = estimate_curve([mean_of_cycles(point) for point in group], SPEED, axes)
        scenario = require_model(group[0].scenario, ParticleScenario, "neighbourhoods are of point agents")
        lines.append(Line(name_of(scenario), times, rates, scenario.space.dimensions, find_place(times, "V_p")))
    return lines


def name_of(scenario: ParticleScenario) -> str:
    """Return the neighbourhood and the space of agents in words."""
    hood: Any = scenario.neighbourhood
    name = {
        "nearest": lambda: f"K = {hood.k}",
        "range": lambda: f"range {hood.radius_cm:g}",
        "cone_of_vision": lambda: f"vision {hood.angle_deg:g}°, R = {hood.radius_cm:g}",
        "cone_of_emission": lambda: f"emission {hood.angle_deg:g}°, R = {hood.radius_cm:g}",
    }[hood.kind]()
    return name + SPACES.get((scenario.space.dimensions, scenario.space.boundary), "")


def log_spreads(places: list[Place]) -> FloatArray:
    """Return the standard deviation of the logarithms of places, and then that of each resample."""
    rows = [[place.estimate.value, *place.resampled] for place in places]
    return np.asarray(np.log(rows).std(axis=0, ddof=1))


def spread_of(places: list[Place], trials: int) -> Effect:
    """Return the standard deviation of the logarithms of places, with the interval of resamples."""
    value, *rows = log_spreads(places)
    return resampled(value, np.array(rows), trials - 1)


def spread_ratio(over: list[Place], along: list[Place], trials: int) -> Effect:
    """Return how far some places are apart, over how far others are, in logarithms."""
    value, *rows = np.log(log_spreads(over) / log_spreads(along))
    return exponentiate(resampled(value, np.array(rows), trials))


def in_words(effect: Effect) -> str:
    """Return an effect with its interval."""
    return f"{effect.estimate.value:.2f} ({effect.estimate.low:.2f} to {effect.estimate.high:.2f})"


def write_numbers(lines: list[Line], trials: int) -> None:
    """Write how well the curves collapse, and where their peaks are."""
    peaked = [line for line in lines if line.peak is not None]
    rows = ["place of the peak: V_p [cm/s]; rate of neighbour change there; T_p [cycles]"]
    for line in peaked:
        height = find_place(line.times, "T_p")
        places = (line.peak, line.rate_at_peak(), height)
        rows.append(f"{line.name}: " + "; ".join(_place(each) for each in places if each is not None))
    rows.append("no peak: " + "; ".join(line.name for line in lines if line.peak is None))
    groups = {
        "all": lines,
        "those with a peak": peaked,
        "those with a peak, in two dimensions": [line for line in peaked if line.dimensions == 2],
    }
    for name, group in groups.items():
        apart = collapse([(line.times, line.rates) for line in group], trials)
        rows.append(f"distance of curves over the rate, relative to that over the speed, {name}: {in_words(apart)}")
    for name, group in list(groups.items())[1:]:
        rates, speeds = [line.rate_at_peak() for line in group], [line.peak for line in group if line.peak]
        rows.append(
            f"standard deviation of ln of the peak's place, {name}: "
            f"over the speed {in_words(spread_of(speeds, trials))}, "
            f"over the rate {in_words(spread_of(rates, trials))}, ratio {in_words(spread_ratio(rates, speeds, trials))}"
        )
    rows.append(
        f"T_sync at a rate of {AT_RATE}: " + "; ".join(f"{line.name} {line.time_at(AT_RATE):.3g}" for line in lines)
    )
    OUT.with_suffix(".txt").write_text("\n".join(rows) + "\n")


def _place(place: Place) -> str:
    low, high = np.nanpercentile(place.resampled, [2.5, 97.5])
    return f"{place.estimate.value:.3g} ({low:.3g} to {high:.3g})"


def write_table(lines: list[Line]) -> None:
    """Write the curves."""
    with OUT.with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["curve", "speed_cm_s", "trials", "censored", "t_sync", "low", "high", "rate", "low", "high"])
        for line in lines:
            times, rates = line.times, line.rates
            for place, speed in enumerate(times.x):
                numbers = (times.values[place], *times.intervals[place], rates.values[place], *rates.intervals[place])
                cells = [f"{number:.4g}" for number in numbers]
                writer.writerow([line.name, speed, times.trials[place], f"{times.censored[place]:.3g}", *cells])


def draw(lines: list[Line]) -> None:
    """Draw both panels."""
    figure = Figure(figsize=(9.5, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for line, look in zip(lines, choose_looks(len(lines)), strict=True):
        low, high = line.times.intervals.T
        for axes, x in ((left, line.times.x), (right, line.rates.values)):
            axes.fill_between(x, low, high, color=look.colour, alpha=0.15, linewidth=0)
            axes.loglog(x, line.times.values, marker=look.marker, color=look.colour, markersize=3.5, linewidth=1)
        right.plot([], [], marker=look.marker, color=look.colour, markersize=3.5, linewidth=1, label=line.name)
    left.set(xlabel="V [cm/s]", ylabel="T_sync [cycles]")
    right.set(xlabel="share of links that change in a cycle")
    figure.legend(loc="outside right upper", fontsize="small")
    figure.savefig(OUT.with_suffix(".png"), dpi=130)


if __name__ == "__main__":
    found = read_lines(Path(sys.argv[1]))
    write_table(found)
    draw(found)
    write_numbers(found, int(found[0].times.trials.min()))
