"""Writes the page of a run folder."""

from importlib.util import find_spec
from pathlib import Path

from epuck_sim.errors import EpuckSimError
from epuck_sim.util.atomic_write import atomic_write, check_target

SUFFIXES = (".html", ".htm")
"""Endings of a page's name."""


def write_report(folder: Path | str, path: Path | str) -> None:
    """Write one HTML page about a run folder, complete in itself: it needs no network, and can be sent to others.

    Args:
        folder: A run folder, finished or not; it stays as it is.
        path: The page, whose name ends in `.html`.

    Raises:
        StoreError: The folder is not a run folder, or its database is damaged.
        EpuckSimError: The page cannot be written, or plotly is not installed.
    """
    target = Path(path)
    if target.suffix not in SUFFIXES:
        raise EpuckSimError(f"{target}: unknown format {target.suffix!r}; allowed: .html")
    if find_spec("plotly") is None:
        raise EpuckSimError("a report needs plotly, which is not installed: pip install 'epuck-sim[report]'")
    check_target(target)
    from epuck_sim.report.contents import read_contents  # noqa: PLC0415 plotly and scipy take a second
    from epuck_sim.report.page import make_page  # noqa: PLC0415

    page = make_page(read_contents(folder))
    with atomic_write(target) as part:
        part.write_text(page, encoding="utf-8", errors="backslashreplace")
