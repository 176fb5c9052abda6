"""Progress on stderr while trials are simulated that nobody watches."""

from collections.abc import Callable, Iterable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn


def trials_bar(trials: int) -> Callable[[Iterable[int]], Iterable[int]]:
    """Return a function that passes numbers of trials on, and shows on a terminal's stderr how many there were."""

    def show(numbers: Iterable[int]) -> Iterator[int]:
        console = Console(stderr=True)
        columns = (TextColumn("simulating"), BarColumn(), TextColumn("{task.completed} of {task.total} trials"))
        with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
            task = progress.add_task("", total=trials)
            for number in numbers:
                yield number
                progress.advance(task)

    return show
