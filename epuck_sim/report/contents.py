"""What a page about a run folder shows, read from the folder."""

from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from epuck_sim.runs.folder import database_of
from epuck_sim.runs.reader import PointTrials, read_measure_names, read_points
from epuck_sim.runs.status import Status, read_status
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.statistics.series import has_series
from epuck_sim.statistics.summary import Summaries, summarize


class Quantity(NamedTuple):
    """T_sync, or a measure of one value a trial, at all points."""

    name: str
    points: list[PointTrials]
    summaries: Summaries


class Series(NamedTuple):
    """A measure with a value for each cycle, at all points."""

    name: str
    points: list[PointTrials]


class Contents(NamedTuple):
    """Everything on the page of a run folder."""

    folder: str
    """The folder, as it was given."""
    scenario: str
    """The scenario as the folder keeps it, YAML."""
    changed: datetime
    """When a result was last stored, UTC."""
    status: Status
    points: list[PointTrials]
    quantities: list[Quantity]
    series: list[Series]


def read_contents(folder: Path | str) -> Contents:
    """Read a run folder, also an unfinished one.

    Raises:
        StoreError: The folder is not a run folder, or its database is damaged.
    """
    points = read_points(folder)
    measures = {name: read_points(folder, name) for name in read_measure_names(folder)}
    series = [Series(name, found) for name, found in measures.items() if _is_series(found)]
    has_t_sync = all(point.has_t_sync for point in points)
    values = {"T_sync": points} if has_t_sync else {}
    values |= {name: found for name, found in measures.items() if not _is_series(found)}
    quantities = [Quantity(name, found, summarize(found)) for name, found in values.items()]
    stored = Path(folder) / RUN_SCENARIO
    text = stored.read_text(encoding="utf-8", errors="replace") if stored.is_file() else ""
    changed = datetime.fromtimestamp(database_of(folder).stat().st_mtime, UTC)
    return Contents(str(folder), text, changed, read_status(Path(folder)), points, quantities, series)


def _is_series(points: list[PointTrials]) -> bool:
    return any(map(has_series, points))
