"""The command `compare-film`: a film beside simulated trials of a scenario, which can be fitted to it."""

import os
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.cli.film_options import (
    CornersOption,
    HeightOption,
    LensOption,
    PeriodOption,
    RobotsOption,
    TagsOption,
    arena_option,
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
    arena: Annotated[str | None, arena_option("as in SCENARIO")] = None,
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
            metavar="STEM|FILE",
            help="Draw the film beside the trials, as STEM.png and STEM.svg or one picture, FILE.png, FILE.svg or "
            "FILE.pdf, with all values as CSV beside it.",
            rich_help_panel=OUTPUT,
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
        from epuck_sim.cli.film_comparison_tables import print_comparison, print_comparison_json
        from epuck_sim.cli.progress import print_stderr, progress_bar
        from epuck_sim.cli.trials_bar import trials_bar
        from epuck_sim.overhead import compare
        from epuck_sim.overhead.robots import find_robots
        from epuck_sim.overhead.track import track_film
        from epuck_sim.scenario.embodied import EmbodiedScenario
        from epuck_sim.scenario.loader import load_scenario
        from epuck_sim.scenario.scenario import require_model

        loaded = require_model(load_scenario(scenario, overrides or ()), EmbodiedScenario, "films are of robots")
        options = scene_options(arena, height, corners, period, robots, tags)
        _check_outputs({"the film": film, "SCENARIO": scenario}, plot, fit)
        if fit is not None:
            compare.check_one_group(loaded)
        simulated_cm = (loaded.arena.width_cm, loaded.arena.height_cm)
        track = track_film(film, options, None, progress_bar("tracking"), lens, simulated_cm)
        found = find_robots(track)
        floor_cm = track.geometry.floor_cm
        untold = track.reasons if track.confidence == "none" else ()
        for warning in (*untold, *track.warnings, *found.warnings):
            print_stderr(f"warning: {warning}")
        if floor_cm != simulated_cm:
            print_stderr(
                f"warning: the film's floor is {floor_cm[0]:g} x {floor_cm[1]:g} cm, that of {loaded.name} "
                f"{simulated_cm[0]:g} x {simulated_cm[1]:g} cm; if they are the same, check --arena-cm or SCENARIO"
            )
        rows = compare.compare_film(track, found, loaded, trials, trials_bar(trials))
        fitted = compare.fitted_values(loaded, track, found)
        (print_comparison_json if as_json else print_comparison)(film, loaded.name, rows, fitted)
        if plot is not None:
            from epuck_sim.figures.film_comparison import save_comparison_figure

            save_comparison_figure(plot, rows)
        if fit is not None:
            compare.save_fitted(fit, compare.fit_scenario(loaded, fitted), fitted, film)


def _check_outputs(inputs: dict[str, str], plot: Path | None, fit: Path | None) -> None:
    """Raise EpuckSimError if an output cannot be written, or has the name of an input or of another output."""
    from epuck_sim.util.atomic_write import check_target

    given: list[tuple[str, Path]] = []
    if plot is not None:
        from epuck_sim.figures.saving import check_files, parse_target

        stem, formats = parse_target(plot)
        given += [("--plot", file) for file in check_files(stem, (*formats, ".csv"))]
    if fit is not None:
        check_target(fit)
        given.append(("--fit", fit))
    owners = {os.path.realpath(path): name for name, path in inputs.items()}
    for option, path in given:
        owner = owners.setdefault(os.path.realpath(path), option)
        reject_first((owner != option, f"{option} writes {path}; allowed: another name, because it belongs to {owner}"))
