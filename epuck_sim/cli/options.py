"""Options that several commands share, completion in shells, and long helps that are folded."""

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from epuck_sim.cli.errors import exit_on_error, note_if_slow, print_stderr, print_warnings
from epuck_sim.errors import CODE_CHECKS, EpuckSimError

if TYPE_CHECKING:  # or --help would wait for pydantic
    from epuck_sim.scenario.embodied import EmbodiedScenario
    from epuck_sim.scenario.particles import ParticleScenario

FOLDED = ("More output", "Live view", "Controllers", "Sweeps", "Looks")
"""Headings of groups of options that `--help` leaves out, and `--help-all` shows."""


def option(shown: str, said: str, heading: str | None = None, **more: Any) -> Any:
    """Return an option, given as its help shows it: `--of NAME`, `--json` for a flag, or the value alone: `FILE.csv`.

    It is in the group of options with this heading; `more` are further arguments of `typer.Option`.
    """
    name, _, value = shown.partition(" ") if shown.startswith("-") else ("", "", shown)
    names = [name] if name else []
    return typer.Option(*names, metavar=value, help=said, rich_help_panel=heading, **more)


def argument(shown: str, said: str, **more: Any) -> Any:
    """Return an argument as its help shows it; `more` are further arguments of `typer.Argument`."""
    return typer.Argument(metavar=shown, help=said, **more)


def options_of(*headings: str) -> Iterator[Callable[..., Any]]:
    """Yield, for each heading, the function that makes an option of its group; see `option`."""
    return (partial(option, heading=heading) for heading in headings)


scenario_option, output_option = options_of("Scenario", "Output")
more_output_option, live_option, controllers_option, sweeps_option, looks_option = options_of(*FOLDED)

WEB_PORT = 9090  # default port of viewers for browsers

GONE = {
    "run --status": "--status is a command of its own: epuck-sim status FOLDER",
    "run --durable": "--durable is no longer needed: results are synced to disk at each commit; leave it out",
    "run --trial-timeout": "--trial-timeout is a key of the scenario: --set trial_timeout_s=SECONDS",
    "check --time": "--time of `check` is a command of its own: epuck-sim plan SCENARIO --seconds 5",
    "replicate --full": "--full is --until-decided now, which adds trials until claims are decided",
    "replicate --quick": "--quick is no longer needed: each sweep of a claim has one version; leave it out",
}
"""Removed options, by their command, and what to do instead."""


class Commands(TyperGroup):
    """The commands; errors end them as in `exit_on_error`, and for a removed option they say what to do instead."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was asked for."""
        with exit_on_error(), print_warnings():
            try:
                return super().invoke(ctx)
            except Exception as error:
                if isinstance(error, typer.BadParameter):
                    error.message = error.message.removeprefix("Value error, ")  # pydantic's, of a name that is none
                if re.search("[( ][\u2013\u2014]\\w", str(error)):  # what text processors make of two hyphens
                    error.message = f"{error}; an option begins with two hyphens: --"  # type: ignore[attr-defined]
                used = f"{ctx.invoked_subcommand} {getattr(error, 'option_name', '')}"
                if (gone := GONE.get(used)) is None:
                    raise
                raise EpuckSimError(gone) from error


def _show_everything(ctx: typer.Context, wanted: bool) -> None:
    if wanted:
        formatter = ctx.make_formatter()
        TyperCommand.format_help(ctx.command, ctx, formatter)  # type: ignore[arg-type]  # a FoldedCommand is one
        typer.echo(formatter.getvalue(), nl=False)
        raise typer.Exit


HelpAllOption = Annotated[
    bool, option("--help-all", "Show further options, too.", is_eager=True, callback=_show_everything)
]


class FoldedCommand(TyperCommand):
    """A command whose `--help` leaves out the groups of options in `FOLDED`, which `--help-all` shows."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        every = self.params
        self.params = [each for each in every if getattr(each, "rich_help_panel", None) not in FOLDED]
        super().format_help(ctx, formatter)
        self.params = every  # which shells complete


def complete(module: str, kind: str) -> Callable[[], Any]:
    """Return the function by which shells complete the names that are shipped, or offered by installed packages."""
    return lambda: getattr(import_module(module), kind).offers


ScenarioArgument = Annotated[
    str,
    argument(
        "SCENARIO",
        "A YAML file, a scenario's name (see `list`), or a run folder.",
        autocompletion=complete("epuck_sim.scenario.loader", "SCENARIO"),
        show_default=False,
    ),
]
SetOption = Annotated[list[str] | None, scenario_option("--set KEY=VALUE", "Change a value: count=5; repeatable.")]
AxesOption = Annotated[
    list[str] | None,
    scenario_option(
        "--sweep KEY=V,V",
        "Add an axis: count=5,10, or count=5:50:10:lin for 10 even steps, :log for even factors; repeatable.",
    ),
]
TrialsOption = Annotated[int | None, scenario_option("N", "Trials; in a sweep, at each point.", min=1, max=10_000_000)]
ControllerOption = Annotated[
    str | None,
    scenario_option(
        "FILE",
        "Run this controller on all robots, with their parameters.",
        autocompletion=complete("epuck_sim.control.loader", "CONTROLLER"),
    ),
]
MeasureOption = Annotated[
    list[str] | None,
    scenario_option(
        "--measure FILE",
        "Add a measure: a name (see `list --measures`) or a file; repeatable.",
        autocompletion=complete("epuck_sim.measures.measure", "MEASURE"),
    ),
]
QuickOption = Annotated[bool, scenario_option("--quick", "Use the scenario's quick version.")]
WorkersOption = Annotated[int | None, sweeps_option("N", "Worker processes; all cores by default.", min=1)]
DaskOption = Annotated[str | None, sweeps_option("ADDRESS", "Run on this Dask scheduler's workers.")]
PointOption = Annotated[int | None, sweeps_option("K", "One trial of a sweep: number of its point, from 0.", min=0)]
TrialOption = Annotated[int | None, sweeps_option("J", "One trial of a sweep: its number, from 0.", min=0)]
InterpretOption = Annotated[bool, controllers_option("--interpret", "Run controllers as plain Python.")]
WebOption = Annotated[bool, live_option("--web", "Show it in a browser instead of a window.")]
PortOption = Annotated[int | None, live_option("PORT", f"Port of --web; {WEB_PORT} by default.", min=1, max=65535)]
FolderArgument = Annotated[Path, argument("FOLDER", "A run folder, as `run --out` makes it.", show_default=False)]
FoldersArgument = Annotated[list[Path], argument("FOLDER", "Run folders, as `run --out` makes them.")]
OfOption = Annotated[
    str | None,
    option(
        "--of NAME",
        "A measure of the folder's trials, or t_sync_s, T_sync in seconds; by default T_sync in cycles.",
        callback=lambda of: None if of == "T_sync" else of,
    ),
]
WhereOption = Annotated[
    list[str] | None,
    option("--where KEY=V,V", "Take only points at which an axis has one of these values: count=5,10; repeatable."),
]
TrustOption = Annotated[bool, sweeps_option("--trust", "Run the code in another user's run folder, as you.")]


def _only_one(context: typer.Context, wanted: bool) -> bool:
    if wanted and (context.params.get("as_json") or context.params.get("as_csv")):  # whichever was given first
        raise EpuckSimError("--json and --csv exclude each other")
    return wanted


JsonOption = Annotated[bool, output_option("--json", "Print JSON.", callback=_only_one)]
CsvOption = Annotated[bool, output_option("--csv", "Print the table as CSV.", callback=_only_one)]


def read_scenario(
    scenario: str | Path,
    settings: Sequence[str] | None = None,
    axes: Sequence[str] | None = None,
    *,
    measures: Sequence[str] | None = None,
    controller: str | None = None,
    quick: bool = False,
    trusted: bool = False,
) -> "EmbodiedScenario | ParticleScenario":
    """Return the scenario that a command's options name and change, and print its notes; see `load_scenario`.

    Code in a run folder is run only if this user trusts it, or with `trusted`.
    """
    from epuck_sim.runs.sources import ask_for_trust
    from epuck_sim.scenario.loader import load_scenario

    if trusted:
        CODE_CHECKS.append(partial(ask_for_trust, trusted=True))
    with note_if_slow(f"reading {scenario}"):
        loaded = load_scenario(
            scenario, settings or (), axes or (), measures=measures or (), controller=controller, quick=quick
        )
    for note in loaded.notes:
        print_stderr(f"note: {note}")
    return loaded


def check_outputs(
    inputs: Mapping[str, str],
    outputs: Mapping[str, tuple[Path | None, Sequence[str] | None]],
    files: Mapping[str, Sequence[Path]],
) -> None:
    """Check, before a command's slow work, that its output files can be written."""
    from epuck_sim.util.atomic_write import check_target

    owners = {os.path.realpath(path): name for name, path in inputs.items()}
    for option, (path, endings) in outputs.items():
        if path is None:
            continue
        if endings is not None and path.suffix not in endings:
            raise EpuckSimError(f"{option} is {path}; allowed: a name that ends in {' or '.join(endings)}")
        for file in files.get(option, [path]):
            check_target(file)
            if (owner := owners.setdefault(os.path.realpath(file), option)) != option:
                raise EpuckSimError(f"{option} is {path}; allowed: another name, because {file} belongs to {owner}")
