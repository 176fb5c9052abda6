"""Compare T_sync with that of other simulators, point by point: `python -m docs.validation [FOLDER]`.

Trials of theirs are the tables in docs/peers; ours go into run folders in FOLDER, runs/validation by default, and a
command that was stopped goes on. Writes docs/validation.md and its figure, and ends with 1 if anything is found.
"""

import argparse
import csv
import gzip
import json
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from scipy import stats

from epuck_sim import load_scenario, read_points, run_sweep
from epuck_sim.estimate import Estimate
from epuck_sim.figures.labels import format_axis_values
from epuck_sim.figures.style import COLUMN_CM, choose_looks, style
from epuck_sim.statistics.comparison import contrast, holm, mean_contrast, pair_up
from epuck_sim.statistics.statistic import Measured, mean_and_error, measure_t_sync
from epuck_sim.util.atomic_write import atomic_write

DOCS = Path(__file__).parent
SEED = 35  # of all sweeps: no other page has trials of it
LEVEL = 0.025
"""Chance of a finding in single points, and of one in whole tables, if the simulators agree: 0.05 together."""
FARTHEST = 3  # number of points that the page names
LIMIT = "stop.max_cycles"

Row = Mapping[str, str]


class Peer(NamedTuple):
    """Another simulator's table, and what our trials of its points are."""

    table: str  # stem of its file in docs/peers
    what: str
    scenario: str
    trials: int  # number of our trials a point
    axes: Callable[[Row], dict[str, Any]]  # returns the keys of our scenario at the point of a row

    def read(self) -> list[list[Row]]:
        """Return the rows of each point, in the table's order."""
        found: dict[tuple[str, ...], list[Row]] = {}
        with gzip.open(DOCS / "peers" / f"{self.table}.csv.gz", "rt", encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                key = tuple(text for name, text in row.items() if name not in ("T_sync", "censored"))
                found.setdefault(key, []).append(row)
        return list(found.values())


def _robots(row: Row) -> dict[str, Any]:
    return {
        **dict.fromkeys(("arena.width_cm", "arena.height_cm"), float(row["L_cm"])),
        "robots.0.count": int(row["N"]),
        "robots.0.camera.central_pixels": int(row["pixels"]),
        "robots.0.parameters.period_s": int(row["tau_ms"]) / 1000,
        "robots.0.parameters.coupling": float(row["epsilon"]),
        "robots.0.parameters.speed_cm_s": int(row["V_mm_s"]) / 10,
        LIMIT: 10_000,
    }


def _robots_of_chapter_3(row: Row) -> dict[str, Any]:
    side, radius = float(row["L_cm"]), float(row["R_cm"])
    return {
        **dict.fromkeys(("arena.width_cm", "arena.height_cm"), side),
        "robots.0.count": int(row["N"]),
        "robots.0.parameters.period_s": float(row["tau_s"]),
        "robots.0.parameters.coupling": float(row["epsilon"]),
        "robots.0.signal.angle_deg": float(row["theta_deg"]),
        "robots.0.signal.range_cm": 1.5 * side if radius < 0 else radius,
        "robots.0.parameters.speed_cm_s": float(row["V_cm_s"]),
        LIMIT: 500,
    }


def _agents(row: Row) -> dict[str, Any]:
    cone = {"kind": "cone_of_vision", "radius_cm": float(row["R"] or 0), "angle_deg": float(row["theta"] or 0)}
    return {
        "space.side_cm": float(row["L"]),
        "neighbourhood": {"kind": "nearest", "k": int(row["K"])} if row["nbhd"] == "knn" else cone,
        "response.curve": {"mult": "multiplicative", "saw": "sawtooth", "sine": "sine"}[row["prc"]],
        "response.coupling": float(row["strength"]),
        "response.refractory": float(row["D"]),
        "stop.metric": {"eta": "reference", "r": "complex"}[row["metric"]],
        "stop.order_parameter": 1 - float(row["tol"]),
        LIMIT: int(row["T_cens"]),
        "agents.speed_cm_s": float(row["V"]),
    }


PEERS = (
    Peer("enki_robots", "robots of chapter 4, Enki", "thesis", 100, _robots),
    Peer("enki_chapter3", "robots of chapter 3, Enki", "fig-3-7", 20, _robots_of_chapter_3),
    Peer("points_cpp", "point agents, C++", "particles", 40, _agents),
)


class Compared(NamedTuple):
    """A point of both simulators."""

    axes: Mapping[str, Any]
    theirs: Measured
    ours: Measured
    p_values: Mapping[str, float]  # of each test, by its name; empty where all trials of both have one value
    z: float  # that of the test of Mann and Whitney: above 0 if ours takes longer


def compare_point(axes: Mapping[str, Any], theirs: Measured, ours: Measured) -> Compared:
    """Test whether two samples have one distribution; trials censored at the common limit are longest."""
    if len(np.unique(np.concatenate([theirs.values, ours.values]))) == 1:
        return Compared(axes, theirs, ours, {}, 0.0)
    ranks = stats.mannwhitneyu(ours.values, theirs.values, use_continuity=False, method="asymptotic")
    p_values = {
        "Mann-Whitney": float(ranks.pvalue),
        "Kolmogorov-Smirnov": float(stats.ks_2samp(ours.values, theirs.values).pvalue),
    }
    if not (ours.observed.all() and theirs.observed.all()):
        times = [
            stats.CensoredData(each.values[each.observed], right=each.values[~each.observed]) for each in (theirs, ours)
        ]
        p_values["log-rank"] = float(stats.logrank(*times).pvalue)
    larger = ranks.statistic > len(ours.values) * len(theirs.values) / 2
    return Compared(axes, theirs, ours, p_values, float(stats.norm.isf(ranks.pvalue / 2)) * (1 if larger else -1))


class Overall(NamedTuple):
    """All points of a table."""

    peer: Peer
    points: Sequence[Compared]
    compared: int  # number of points at which not all trials have one value
    chi_square: float  # sum of z squared
    ratio: Estimate  # geometric mean over points of the mean of ours over that of theirs
    p_values: Mapping[str, float]  # of each test of the whole table, by its name


def compare_table(peer: Peer, points: Sequence[Compared]) -> Overall:
    """Test whether the points of a table differ by more than chance, and whether they do in one direction."""
    z = np.array([each.z for each in points if each.p_values])
    chi_square = float(z @ z)
    shift = float(z.sum()) / math.sqrt(len(z))
    p_values = {"chi-square": float(stats.chi2.sf(chi_square, len(z))), "shift": float(2 * stats.norm.sf(abs(shift)))}
    means = [contrast(pair_up(each.theirs, each.ours), of_logarithms=True) for each in points]
    ratio = mean_contrast(means).apply(math.exp)
    return Overall(peer, points, len(z), chi_square, ratio, p_values)


def findings(tables: Sequence[Overall]) -> tuple[float, float]:
    """Return the smallest p-value of any point, and of any table, each corrected by Holm's method."""
    single = [p for table in tables for point in table.points for p in point.p_values.values()]
    whole = [p for table in tables for p in table.p_values.values()]
    return min(holm(single)), min(holm(whole))


def run(peer: Peer, folder: Path, every: int, workers: int | None) -> Overall:
    """Run what is missing of our trials at every so many points of a table, and compare."""
    groups = peer.read()[::every]
    sweep = json.dumps({"points": [peer.axes(rows[0]) for rows in groups]})
    scenario = load_scenario(peer.scenario, [f"trials={peer.trials}", f"seed={SEED}", f"sweep={sweep}"])
    own = folder / (peer.table if every == 1 else f"{peer.table}-{every}")
    own.parent.mkdir(parents=True, exist_ok=True)
    if run_sweep(scenario, own, workers).failed:
        sys.exit(f"{own}: trials failed; see epuck-sim status")
    compared = []
    for ours, rows in zip(map(measure_t_sync, read_points(own)), groups, strict=True):
        times, ended = np.array([(row["T_sync"], row["censored"] == "0") for row in rows], float).T
        theirs = Measured(times, ended == 1, ours.limit, SEED)
        compared.append(compare_point(peer.axes(rows[0]), theirs, ours))
    return compare_table(peer, compared)


PAGE = """# Validation against other simulators

*For whoever asks whether other programs find the same.*

T_sync of this program is compared, point by point, with that of
[simulators that share no code with it](peers/README.md): Enki, in which the thesis's robots were simulated, and a C++
program of the point agents. `{command}` makes this page from their tables and its own trials (seed {seed}),
and ends with exit code 1 if anything is found.

{verdict}

|  | points compared | trials, theirs | ours | ratio of means | chi-square | p | of a shift | smallest |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
{tables}

At each point the tests of Mann and Whitney, of Kolmogorov and Smirnov and, where trials are censored, the log-rank
test ask whether both samples have one distribution; points at which all trials have one value are left out. Over a
table, the sum of z squared of the first test is compared with chi-square (differences either way), and the sum of z
with the normal distribution (a shift). p-values of all points, and of all tables, are corrected by Holm's method;
something is found if the smallest of either is below {level}. The ratio of means, ours over theirs, is the geometric
mean over points, with its 95 % interval; means of censored trials are restricted to the limit of cycles.

Robots of chapter 3 see by Enki's camera in both ([signals.md](signals.md)).

![Ratios of means, and z of all points beside the normal distribution](figures/validation.png)

The points that are farthest apart, with uncorrected p-values:

|  | point | mean, theirs | ours | smallest p |
| --- | --- | --- | --- | --- |
{farthest}
"""


def write_page(tables: Sequence[Overall], page: Path, figure: Path, command: str) -> None:
    """Write the page and its figure."""
    smallest, overall = findings(tables)
    verdict = (
        f"**{'A difference is found' if min(smallest, overall) < LEVEL else 'No difference is found'}**: "
        f"{sum(each.compared for each in tables)} points are compared, in which the smallest corrected p-value is "
        f"{smallest:.2g}; that of whole tables is {overall:.2g}."
    )
    rows = [
        [
            each.peer.what,
            f"{each.compared} of {len(each.points)}",
            f"{sum(len(point.theirs.values) for point in each.points):,}",
            f"{sum(len(point.ours.values) for point in each.points):,}",
            str(each.ratio),
            f"{each.chi_square:.1f}",
            *(f"{p:.2g}" for p in each.p_values.values()),
            f"{min(p for point in each.points for p in point.p_values.values()):.2g}",
        ]
        for each in tables
    ]
    given = {"command": command, "seed": SEED, "level": LEVEL, "verdict": verdict}
    draw(tables, figure)
    with atomic_write(page) as part:
        text = PAGE.format(tables=_lines(rows), farthest=_lines(_farthest(tables)), **given)
        part.write_text(text, encoding="utf-8")


def _farthest(tables: Sequence[Overall]) -> list[list[str]]:
    known = [(min(point.p_values.values()), each, point) for each in tables for point in each.points if point.p_values]
    return [
        [
            each.peer.what,
            format_axis_values({key: point.axes[key] for key in _telling(each.points)}),
            *(f"{mean_and_error(sample).mean:.4g}" for sample in (point.theirs, point.ours)),
            f"{p:.2g}",
        ]
        for p, each, point in sorted(known, key=lambda found: found[0])[:FARTHEST]
    ]


def _telling(points: Sequence[Compared]) -> list[str]:
    """Return the axes that tell points of a table apart; of two that always agree the first alone."""
    columns = {key: tuple(map(str, (point.axes[key] for point in points))) for key in points[0].axes}
    known = {column: key for key, column in reversed(columns.items()) if not key.startswith("stop.")}
    return [key for key in columns if key in known.values() and len(set(columns[key])) > 1]


def _lines(rows: Iterable[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows)


def draw(tables: Sequence[Overall], path: Path) -> None:
    """Draw the ratio of means over theirs, and z beside the normal distribution."""
    with rc_context(style()), atomic_write(path) as part:
        figure = Figure(figsize=(2 * COLUMN_CM / 2.54, COLUMN_CM / 2.54), layout="constrained")
        left, right = figure.subplots(1, 2)
        for each, look in zip(tables, choose_looks(len(tables)), strict=True):
            points = [point for point in each.points if point.p_values]
            theirs, ours = (
                np.array([mean_and_error(sample).mean for sample in samples])
                for samples in zip(*((point.theirs, point.ours) for point in points), strict=True)
            )
            looks: dict[str, Any] = {"color": look.colour, "marker": look.marker, "linestyle": "", "markersize": 2.5}
            left.semilogx(theirs, ours / theirs, label=each.peer.what, **looks)
            quantiles = stats.norm.ppf((np.arange(len(points)) + 0.5) / len(points))
            right.plot(quantiles, np.sort([point.z for point in points]), **looks)
        left.axhline(1, color="0.35", linewidth=0.6)
        right.axline((0, 0), slope=1, color="0.35", linewidth=0.6)
        left.set(xlabel="mean T_sync of theirs [cycles]", ylabel="mean of ours over that of theirs")
        right.set(xlabel="quantile of the normal distribution", ylabel="z of Mann and Whitney")
        figure.legend(loc="outside upper center", ncols=len(tables))
        figure.savefig(part, format="png", dpi=130)


def main(words: Sequence[str] | None = None) -> int:
    """Run, write the page, print the verdict, and return 1 if anything is found."""
    parser = argparse.ArgumentParser(prog="python -m docs.validation", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("runs/validation"), help="folder of run folders")
    every = "take every such point of a table; the page goes into FOLDER"
    parser.add_argument("--every", type=int, default=1, help=every)
    parser.add_argument("--workers", type=int, help="worker processes; all cores by default")
    given = parser.parse_args(words)
    tables = [run(peer, given.folder, given.every, given.workers) for peer in PEERS]
    out, more = (DOCS, "") if given.every == 1 else (given.folder, f" --every {given.every}")
    (out / "figures").mkdir(exist_ok=True)
    write_page(tables, out / "validation.md", out / "figures/validation.png", f"python -m docs.validation{more}")
    smallest, overall = findings(tables)
    print(f"smallest p of a point {smallest:.2g}, of a table {overall:.2g}, corrected; {out / 'validation.md'}")
    return int(min(smallest, overall) < LEVEL)


if __name__ == "__main__":
    sys.exit(main())
