"""The commands `page` and `play`: a scenario as a page in which it runs."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, print_warnings, word_if_slow
from epuck_sim.cli.options import ScenarioArgument, SetOption

pages = typer.Typer()


@pages.command()
def page(
    scenario: ScenarioArgument,
    out: Annotated[Path, typer.Option(metavar="PAGE.html", help="The page, which is complete in itself.")],
    settings: SetOption = None,
) -> None:
    """Write SCENARIO as one HTML file in which it runs: with the program's own kernels, without server and network."""
    with exit_on_error():
        from epuck_sim.page.writer import write_page

        with word_if_slow(f"making the page of {scenario}"), print_warnings():
            write_page(scenario, out, settings or ())
        typer.echo(out)


@pages.command()
def play(scenario: ScenarioArgument = "thesis", settings: SetOption = None) -> None:
    """Open SCENARIO as a page in the browser, from a temporary file."""
    with exit_on_error():
        from epuck_sim.page.writer import open_page

        with word_if_slow(f"making the page of {scenario}"), print_warnings():
            path = open_page(scenario, settings or ())
        typer.echo(path)
