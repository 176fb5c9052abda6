"""Output of commands: tables for people, JSON and CSV for programs."""

import json
import math
import re
import shutil
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from epuck_sim.display.html import in_words
from epuck_sim.display.table import Row, Share, Table, plain
from epuck_sim.estimate import Estimate, significant
from epuck_sim.util.messages import counted
from epuck_sim.util.provenance import format_versions, versions

if TYPE_CHECKING:  # or a trial would wait for OpenCV and scipy
    from epuck_sim.overhead.compare import QuantityComparison
    from epuck_sim.overhead.robots import Robots
    from epuck_sim.overhead.track import Track
    from epuck_sim.runs.reader import Failure, PointAtLimit, Status
    from epuck_sim.trial.result import TrialResult


def show(tables: Sequence[Table], found: Any, *, as_json: bool, as_csv: bool = False) -> None:
    """Print tables on stdout, or what was found as JSON, or the first table as CSV."""
    if as_json:
        print(json.dumps(plain(found)))
    elif as_csv:
        print(tables[0].to_csv(), end="")
    else:
        print("\n\n".join(table.to_text(terminal_width()) for table in tables))


def print_json(found: Any) -> None:
    """Print what was found, and the versions, as one JSON object on a line of stdout, at once."""
    print(json.dumps({**plain(found), "versions": versions()}), flush=True)


def terminal_width() -> int | None:
    """Return the width of stdout in letters; None if it is no terminal."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def folded(line: str) -> str:
    """Return a line wrapped to a terminal's width, further lines indented; numbers stay with the word after them."""
    line, width = line.replace("\n", " "), terminal_width()
    tied = re.sub(r"(?<=\d) (?=\w)", "\0", line)  # as one word
    lines = [tied] if width is None else textwrap.wrap(tied, width - 4, break_long_words=False)
    return "\n    ".join(lines).replace("\0", " ")


def print_trials(results: "Sequence[TrialResult]", max_cycles: int) -> None:
    """Print a table of trials of one scenario on stdout, and for several trials a line of statistics."""
    if not results:
        return
    headings = {
        "t_sync": "T_sync (cycles)",
        "simulated_s": "simulated (s)",
        "wall_s": "wall (s)",
        "real_time": "x real time",
        **{name: name for name in results[0].measures},
    }
    has_order = any(result.order_parameter is not None for result in results)
    rows = [Row({"seed": each.seed}, _cells_of_trial(each, has_order=has_order)) for each in results]
    print(Table(results[0].scenario, rows, (), headings).to_text(terminal_width()))
    if len(results) > 1 and results[0].censored is not None:
        print(folded(_summary(results, max_cycles)))


def _cells_of_trial(result: "TrialResult", *, has_order: bool) -> dict[str, Any]:
    """Return the cells that apply to a trial of its scenario: without oscillators there is no T_sync."""
    cells: dict[str, Any] = {}
    if result.censored is not None:
        censored = f"yes, at {result.cycles}" if result.censored else "no"
        cells |= {"t_sync": result.t_sync_cycles, "censored": censored}
    if result.censored is not None or has_order:
        cells["order_parameter"] = result.order_parameter
    cells |= {"simulated_s": result.simulated_s, "wall_s": result.wall_s, "real_time": result.real_time_factor}
    return {**cells, **result.measures}


def _summary(results: "Sequence[TrialResult]", max_cycles: int) -> str:
    from epuck_sim.statistics import Statistic
    from epuck_sim.statistics.statistic import Measured, estimate  # which takes scipy

    times = np.array([result.cycles for result in results], float)
    is_observed = np.array([not result.censored for result in results])
    measured = Measured(times, is_observed, max_cycles, results[0].seed)
    if not is_observed.any():
        return f"T_sync: all of {len(results)} trials are censored"
    mean, median = (estimate(measured, statistic) for statistic in (Statistic.MEAN, Statistic.MEDIAN))
    ends = f"{mean.name} {mean}, {median.name} {median}"
    return f"T_sync: {ends}; {np.count_nonzero(~is_observed)} censored"  # in 80 columns


MOST_LISTED = 10  # maximum number of kinds of failures, and of shares without a folder, that are listed

_OF_ONE_TRIAL = re.compile(r"^.*?, seed \d+: (?:[^:]*/(?=[^/:]+:\d+: ))?")
"""Beginning of an error that others of its kind do not share: whose it is, and the folders of its file."""


def print_status(status: "Status", as_json: bool, looks: Table | None = None) -> None:
    """Print on stdout how far a sweep is, and the looks at its points if there were any."""
    if as_json:
        until = {} if looks is None else {"until": looks.records()}
        print(json.dumps({**plain(status), **until}))
        return
    share = "" if status.share is None else f"share {status.share}, "
    censored = "" if status.censored is None else f"censored: {status.censored}; "
    lines = [
        f"{status.scenario}: {share}{counted(status.points, 'point')}, "
        f"{status.stored} of {status.trials} trials have a result",
        f"{censored}failed: {len(status.failed)}; computing time: {in_words(status.wall_s)}",
    ]
    if status.unmeasured:
        lines.append(f"{status.unmeasured} of these results lack measures that were added later")
    lines += (f"{counted(row.trials, 'trial')}: {format_versions(row.made_by)}" for row in status.versions)
    if status.at_work:
        lines.append(f"{status.at_work} is at work on it")
    lines += describe_at_limit(status.at_limit)
    lines += describe_failures(status.failed)
    print("\n  ".join(map(folded, lines)))
    if looks is not None:
        print(f"\n{looks.to_text(terminal_width())}")


def describe_failures(failures: "Sequence[Failure]") -> Iterator[str]:
    """Yield a line for each kind of error, with the number of its trials; one that has one trial stays whole."""
    kinds: dict[str, list[Failure]] = {}
    for failure in failures:
        kind = re.sub(r"(--point|--trial) \d+", r"\1 N", _OF_ONE_TRIAL.sub("", failure.error))
        kinds.setdefault(kind, []).append(failure)
    for kind, (first, *others) in [*kinds.items()][:MOST_LISTED]:
        place = f"--point {first.point} --trial {first.trial}"
        said = f"{1 + len(others)} trials: {kind}; the first: {place}" if others else f"{place}: {first.error}"
        yield f"failed: {said}"
    if rest := sum(map(len, [*kinds.values()][MOST_LISTED:])):
        yield f"and {rest} more"


def describe_at_limit(points: "Sequence[PointAtLimit]") -> list[str]:
    """Return a line that counts points whose trials all reach their limit, names the first, and says what to do."""
    from epuck_sim.scenario.loader import describe_axes

    if not points:
        return []
    first = describe_axes(points[0].axes)
    at = f"at {len(points)} points, the first with {first}" if len(points) > 1 else f"at {first}" if first else ""
    trials = sum(each.trials for each in points)
    reached = f"{f'{at}, ' if at else ''}every trial so far ({trials}) reaches the limit"
    return [f"{reached}; go on, or take another limit in a new folder: --set stop.max_cycles=N, or stop.max_time_s=S"]


def print_statuses(statuses: "Mapping[str, Status]", as_json: bool) -> None:
    """Print on stdout how far several run folders are, a line each, and their sum."""
    if as_json:
        print(json.dumps([{"folder": folder, **plain(status)} for folder, status in statuses.items()]))
        return
    for folder, status in statuses.items():
        share = "" if status.share is None else f" (share {status.share})"
        failed = f"; failed: {len(status.failed)}" if status.failed else ""
        at_work = f"; {status.at_work} is at work" if status.at_work else ""
        print(f"{folder}{share}: {status.stored} of {status.trials}{failed}{at_work}")
    given = [status.share for status in statuses.values() if status.share is not None]
    if len(given) < len(statuses) or len({(status.scenario, *status.axes) for status in statuses.values()}) > 1:
        return  # whole sweeps, which include their shares, or shares of several
    stored, trials = (sum(getattr(status, name) for status in statuses.values()) for name in ("stored", "trials"))
    failures = sum(len(status.failed) for status in statuses.values())
    print(f"together: {stored} of {trials} trials have a result; failed: {failures}")
    counts = {share.partition("/")[2] for share in given}
    if len(counts) == 1:  # only then is it known which shares are missing
        (count,) = counts
        every = (f"{number}/{count}" for number in range(1, int(count) + 1))
        missing = [share for share in every if share not in given]
        more = f" and {len(missing) - MOST_LISTED} more" if len(missing) > MOST_LISTED else ""
        if missing:
            print(f"shares without a folder here: {', '.join(missing[:MOST_LISTED])}{more}")


NAMES_WIDTH = 27  # width of the names of results, in letters


def print_track(track: "Track", robots: "Robots | None" = None, *, as_json: bool = False) -> None:
    """Print the summary of a track on stdout, and of its robots if they are given, as a table or a JSON object."""
    identities = {} if robots is None else robots.summary()
    if as_json:
        print_json({**track.summary(), **({"identities": identities} if identities else {})})
        return
    print(track.film)
    for name, value in _lines_of_track(track, identities):
        text = f"{name:{NAMES_WIDTH}}{value}"
        print(textwrap.fill(text, terminal_width() or 80, subsequent_indent=" " * NAMES_WIDTH))


def _lines_of_track(track: "Track", identities: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    estimated = dict.fromkeys(track.estimated, ", estimated")
    doubts = (*(track.reasons if track.confidence == "none" else ()), *track.warnings)
    options = dict.fromkeys(re.findall(r"(?<!\S)--[a-z-]+", " ".join(doubts)))
    if track.t_sync_s is not None:
        yield "T_sync", f"{track.t_sync_cycles} cycles, {track.t_sync_s:.1f} s"
    else:
        yield "T_sync", "unknown" if track.confidence == "none" else "never"
    for reason in track.reasons:
        yield "because", reason
    yield "confidence", track.confidence + (f"; {', '.join(options)} may settle it" if options else "")
    if track.histogram_s is not None:
        yield "by the histogram", f"{track.histogram_periods:.1f} periods, {track.histogram_s:.1f} s"
    yield "frames", f"{track.frames} at {track.fps:.4g} per second"
    yield "trial", f"from {track.start_s:.1f} s, for {track.duration_s:.1f} s"
    yield "geometry from", track.calibration
    yield "period", f"{track.period_s:.4g} s{estimated.get('period_s', '')}"
    yield "flash", f"{track.flash_ms:.0f} ms"
    yield "robots seen", f"{track.robots_seen} at once, {track.flashes_per_period:.1f} flashes per period"
    yield "threshold of the histogram", f"{track.threshold_ms:.0f} ms{estimated.get('threshold_ms', '')}"
    if not identities:
        return
    yield f"robots by {identities['by']}", f"{len(identities['robots'])}"
    unsure = f"{100 * identities['unsure_share']:.0f} % are unsure"
    yield "links between flashes", f"{identities['links']}, of which {unsure}"
    yield "by phases", "never" if identities["by_phases_s"] is None else f"{identities['by_phases_s']:.1f} s"
    yield "pairs that flash together", f"{identities['pairs_together']}"


UNTOLD = (
    "A film does not show coupling, refractory time, what robots see and how late, gains of infrared sensors, wheels' "
    "noise and imbalance, or robots that get stuck: these stay as in the scenario, and may make trials differ from the "
    "film."
)


def print_comparison(
    track: "Track",
    scenario: str,
    rows: "Sequence[QuantityComparison]",
    fitted: Mapping[str, Estimate],
    *,
    as_json: bool = False,
) -> None:
    """Print the verdict and readable tables on stdout, or one JSON object.

    In JSON, null is a value that is unknown, or beyond a film's or trial's end; both are counted.
    """
    from epuck_sim.overhead.compare import judge

    verdict = judge(rows)
    if as_json:
        names = ("name", "unit", "film", "percentile", "beyond", "unknown")
        quantities = [{key: getattr(row, key) for key in names} for row in rows]
        for quantity, row in zip(quantities, rows, strict=True):
            quantity |= {"film_is_beyond": math.isinf(row.film), "trials": row.trials.tolist()}
        head = {"film": track.film, "scenario": scenario, "period_s": track.period_s, "verdict": verdict}
        print_json({**head, "quantities": quantities, "fitted": fitted})
        return
    print(f"{verdict.sentence[0].upper()}{verdict.sentence[1:]}.\n")
    headings = {"trials": "trials: median, 5 % and 95 %", "percentile": "film's percentile"}
    title = f"{track.film}, with a period of {track.period_s:.4g} s, beside trials of {scenario}"
    shown = [Row({}, _cells_of_quantity(row)) for row in rows if not math.isnan(row.film)]
    compared = Table(title, shown, (), headings)
    values = [Row({}, {"key": key, "value": each}) for key, each in fitted.items()]
    told = Table("Values fitted to the film, with 95 % intervals", values, [UNTOLD])
    show([compared, told], None, as_json=False)


def _cells_of_quantity(row: "QuantityComparison") -> dict[str, Any]:
    known = row.trials[~np.isnan(row.trials)]
    low, middle, high = [math.nan] * 3
    if len(known):
        low, middle, high = np.quantile(known, (0.05, 0.5, 0.95), method="nearest").tolist()
    unknown = f", {row.unknown} unknown" if row.unknown else ""
    return {
        "quantity": row.name,
        "unit": row.unit,
        "film": "beyond" if math.isinf(row.film) else significant(row.film),
        "trials": str(Estimate(middle, low, high)).replace("?", "beyond") + unknown,
        "percentile": Share(row.percentile / 100),
    }
