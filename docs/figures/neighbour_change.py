"""Draws T_sync over speed and over the rate of neighbour change: `neighbour_change.py RUN_FOLDER`.

The folder is that of the sweep `neighbour-change`. Writes neighbour-change.png, the curves as neighbour-change.csv, and
how well they collapse as neighbour-change.txt.
"""

import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import read_points
from epuck_sim.arrays import FloatArray
from epuck_sim.display.table import csv_text
from epuck_sim.estimate import Estimate
from epuck_sim.figures.style import choose_looks
from epuck_sim.replication.claims import Check
from epuck_sim.replication.criteria import Effect, collapse, exponentiate, find_place, resampled
from epuck_sim.replication.verdicts import taken
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import require_model
from epuck_sim.statistics.curves import Curve, estimate_curve, group_by_other_axes
from epuck_sim.statistics.extrema import Place

SPEED = "agents.speed_cm_s"
SPACES = {(2, "cyclic"): ", cyclic", (1, "bounded"): ", segment", (3, "bounded"): ", cube"}
AT_RATE = 0.15  # rate of neighbour change at which T_sync is compared, near that of the peaks
MEAN_RATE = Check(test="level", of="neighbour_change", take="mean", above=0)
OUT = Path(__file__).parent / "neighbour-change"


class Line(NamedTuple):
    """A neighbourhood in a space."""

    name: str
    times: Curve  # T_sync over speed, cycles
    rates: Curve  # share of links that change from a cycle to the next, over speed
    dimensions: int  # number of dimensions of the space
    peak: Place | None  # speed at the peak of T_sync, cm/s

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


def read_lines(folder: Path) -> list[Line]:
    """Return the lines of a run folder, in the order of the sweep."""
    lines = []
    points = taken(MEAN_RATE, read_points(folder, of="neighbour_change"))
    for axes, group in group_by_other_axes(points, SPEED):
        times = estimate_curve([point._replace(of=None) for point in group], SPEED, axes)
        rates = estimate_curve(group, SPEED, axes)
        scenario = require_model(group[0].scenario, ParticleScenario, "neighbourhoods are of point agents")
        lines.append(Line(name_of(scenario), times, rates, scenario.space.dimensions, find_place(times, "V_p")))
    return lines


def name_of(scenario: ParticleScenario) -> str:
    """Return the neighbourhood and the space of agents in words."""
    hood: Any = scenario.neighbourhood
    named = {
        "nearest": "K = {k}",
        "range": "range {radius_cm:g}",
        "cone_of_vision": "vision {angle_deg:g}°, R = {radius_cm:g}",
        "cone_of_emission": "emission {angle_deg:g}°, R = {radius_cm:g}",
    }[hood.kind]
    return named.format(**hood.model_dump()) + SPACES.get((scenario.space.dimensions, scenario.space.boundary), "")


def log_spreads(places: list[Place]) -> FloatArray:
    """Return the standard deviation of the logarithms of places, and then that of each resample."""
    rows = [[place.estimate.value, *place.resampled] for place in places]
    return np.asarray(np.log(rows).std(axis=0, ddof=1))


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
        rates = log_spreads([line.rate_at_peak() for line in group])
        speeds = log_spreads([line.peak for line in group if line.peak])
        ratios = np.log(rates / speeds)
        along, over = (in_words(resampled(each[0], each[1:], trials - 1)) for each in (speeds, rates))
        ratio = in_words(exponentiate(resampled(ratios[0], ratios[1:], trials)))
        rows.append(
            f"standard deviation of ln of the peak's place, {name}: "
            f"over the speed {along}, over the rate {over}, ratio {ratio}"
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
    rows = []
    for line in lines:
        times, rates = line.times, line.rates
        for place, speed in enumerate(times.x):
            numbers = (times.values[place], *times.intervals[place], rates.values[place], *rates.intervals[place])
            cells = [f"{number:.4g}" for number in numbers]
            rows.append([line.name, speed, times.trials[place], f"{times.censored[place]:.3g}", *cells])
    columns = ["curve", "speed_cm_s", "trials", "censored", "t_sync", "low", "high", "rate", "low", "high"]
    OUT.with_suffix(".csv").write_text(csv_text(columns, rows))


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
    left.set(xlabel="V (cm/s)", ylabel="T_sync (cycles)")
    right.set(xlabel="share of links that change in a cycle")
    figure.legend(loc="outside right upper", fontsize="small")
    figure.savefig(OUT.with_suffix(".png"), dpi=130)


if __name__ == "__main__":
    found = read_lines(Path(sys.argv[1]))
    write_table(found)
    draw(found)
    write_numbers(found, int(found[0].times.trials.min()))
