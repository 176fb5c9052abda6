"""The command `compare-film`: a film beside simulated trials of a scenario, which can be fitted to it."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.cli.film_options import (
    ArenaOption,
    CornersOption,
    HeightOption,
    LensOption,
    PeriodOption,
    RobotsOption,
    TagsOption,
    robots_finder,
    scene_options,
)

film_comparisons = typer.Typer()

OUTPUT = "Output"


@film_comparisons.command("compare-film")
def compare_film(
    film: Annotated[str, typer.Argument(metavar="FILM", help="The file of a film, of any format, or its URL.")],
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help="A shipped scenario, or a .yaml file.")],
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change the scenario; repeatable.")
    ] = None,
    trials: Annotated[int, typer.Option(min=1, max=10_000, help="Number of simulated trials.")] = 40,
    arena: ArenaOption = None,
    height: HeightOption = None,
    corners: CornersOption = None,
    lens: LensOption = None,
    tags: TagsOption = None,
    period: PeriodOption = None,
    robots: RobotsOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.", rich_help_panel=OUTPUT)] = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png", help="Draw the film beside the trials; their table is .csv.", rich_help_panel=OUTPUT
        ),
    ] = None,
    fit: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.yaml", help="Write the scenario with what the film tells of robots.", rich_help_panel=OUTPUT
        ),
    ] = None,
) -> None:
    """Print what FILM has of T_sync, flashes, speeds and clocks, beside the distributions in simulated trials."""
    with exit_on_error():
        reject_first(
            (fit is not None and fit.suffix not in (".yaml", ".yml"), f"--fit is {fit}; allowed: a name in .yaml"),
        )
        from epuck_sim.cli.film_beside_tables import print_beside, print_beside_json
        from epuck_sim.cli.progress import print_stderr, progress_bar
        from epuck_sim.cli.trials_bar import trials_bar
        from epuck_sim.overhead import film_comparison
        from epuck_sim.overhead.track.track_film import track_film
        from epuck_sim.scenario.embodied import EmbodiedScenario
        from epuck_sim.scenario.loader import load_scenario
        from epuck_sim.scenario.scenario import require_model
        from epuck_sim.util.atomic_write import check_target

        loaded = require_model(load_scenario(scenario, overrides or ()), EmbodiedScenario, "films are of robots")
        options = scene_options(arena, height, corners, period, robots)
        find_robots = robots_finder(tags)
        for target in (plot, fit):
            if target is not None:
                check_target(target)
        track = track_film(film, options, None, progress_bar("tracking"), lens)
        found = find_robots(track)
        for warning in (*track.warnings, *found.warnings):
            print_stderr(f"warning: {warning}")
        fitted_scenario, fitted = film_comparison.overlay(loaded, track, found)
        rows = film_comparison.compare_film(track, found, loaded, trials, trials_bar(trials))
        (print_beside_json if as_json else print_beside)(film, loaded.name, rows, fitted)
        if plot is not None:
            from epuck_sim.figures.film_beside import save_beside_figure

            save_beside_figure(plot, rows)
        if fit is not None:
            film_comparison.save_overlay(fit, fitted_scenario, fitted, film)
