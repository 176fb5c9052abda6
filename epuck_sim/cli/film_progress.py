"""How far a film is, while it is made or tracked: on a terminal's stderr."""

from collections.abc import Iterable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from epuck_sim.overhead.film.frame import Passing, Timed


def passing(doing: str) -> Passing:
    """Return what passes frames, or rows with a time, on and shows on a terminal's stderr how far they are."""

    def show(timed: Iterable[Timed], duration_s: float | None) -> Iterator[Timed]:
        console = Console(stderr=True)
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.0f} s of film"))
        with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
            task = progress.add_task(doing, total=duration_s)
            for each in timed:
                progress.update(task, completed=each[0])
                yield each

    return show
