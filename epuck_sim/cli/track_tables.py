"""What `epuck-sim track` prints: a table, or JSON."""

import json
import re
import textwrap
from collections.abc import Iterator

from epuck_sim.cli.tables import terminal_width
from epuck_sim.overhead.robots import Robots, summary
from epuck_sim.overhead.track import Track
from epuck_sim.util.provenance import versions

NAMES_WIDTH = 27
"""Width of the names of results, in letters."""


def print_track_json(track: Track, robots: Robots | None = None) -> None:
    """Print the summary of a track, and of who is who if that was asked for, as one JSON object on a line of stdout."""
    identities = {} if robots is None else {"identities": summary(track, robots)}
    print(json.dumps({**track.summary(), **identities, "versions": versions()}), flush=True)


def print_track(track: Track, robots: Robots | None = None) -> None:
    """Print the summary of a track, and of who is who if that was asked for, as a readable table on stdout."""
    print(track.film)
    for name, value in (*_lines(track), *(() if robots is None else _lines_about_robots(track, robots))):
        text = f"{name:{NAMES_WIDTH}}{value}"
        print(textwrap.fill(text, terminal_width() or 120, subsequent_indent=" " * NAMES_WIDTH))


def _lines(track: Track) -> Iterator[tuple[str, str]]:
    if track.t_sync_s is not None:
        yield "T_sync", f"{track.t_sync_cycles:.1f} cycles, {track.t_sync_s:.1f} s"
    else:
        yield "T_sync", "unknown" if track.confidence == "none" else "never"
    for reason in track.reasons:
        yield "because", reason
    yield "confidence", track.confidence + _settled_by(track)
    if track.histogram_s is not None:
        yield "by the histogram", f"{track.histogram_periods:.1f} periods, {track.histogram_s:.1f} s"
    yield "frames", f"{track.frames} at {track.fps:.4g} per second"
    yield "trial", f"from {track.start_s:.1f} s, for {track.duration_s:.1f} s"
    yield "geometry from", track.calibration
    yield "period", f"{track.period_s:.4g} s{_if_estimated(track, 'period_s')}"
    yield "flash", f"{track.flash_ms:.0f} ms"
    yield "robots seen", f"{track.robots_seen} at once, {track.flashes_per_period:.1f} flashes per period"
    yield "threshold of the histogram", f"{track.threshold_ms:.0f} ms{_if_estimated(track, 'threshold_ms')}"


def _settled_by(track: Track) -> str:
    """Return which options would settle what is doubtful; nothing if nothing is."""
    doubts = (*(track.reasons if track.confidence == "none" else ()), *track.warnings)
    options = dict.fromkeys(re.findall(r"(?<!\S)--[a-z-]+", " ".join(doubts)))
    return f"; {', '.join(options)} may settle it" if options else ""


def _lines_about_robots(track: Track, robots: Robots) -> Iterator[tuple[str, str]]:
    found = summary(track, robots)
    yield f"robots by {robots.by}", f"{len(robots.numbers)}"
    yield "links between flashes", f"{found['links']}, of which {100 * found['unsure_share']:.0f} % are unsure"
    yield "by phases", "never" if found["by_phases_s"] is None else f"{found['by_phases_s']:.1f} s"
    yield "pairs that flash together", f"{found['pairs_together']}"


def _if_estimated(track: Track, name: str) -> str:
    return ", estimated" if name in track.estimated else ""
