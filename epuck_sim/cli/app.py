"""The `epuck-sim` command: its subcommands, and how signals end it."""

import sys
from functools import cache
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim import __version__
from epuck_sim.cli.films import films
from epuck_sim.cli.options import Commands
from epuck_sim.cli.results import results
from epuck_sim.cli.run import runs
from epuck_sim.cli.scenarios import scenarios
from epuck_sim.cli.terminal import EXIT_CODE, end_on_request
from epuck_sim.errors import CODE_CHECKS

app = typer.Typer(
    cls=Commands,
    help="Simulate swarms of e-puck robots that synchronise like fireflies.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
for commands in (runs, scenarios, films, results):
    app.add_typer(commands)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"epuck-sim {__version__}")
        raise typer.Exit


def _ask_for_trust(path: Path) -> None:
    from epuck_sim.runs.sources import ask_for_trust

    ask_for_trust(path)


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[  # noqa: ARG001
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Hold the options that all commands share, and have all ask for trust, once for each file."""
    CODE_CHECKS[:] = [cache(_ask_for_trust)]
    context.call_on_close(CODE_CHECKS.clear)


def main() -> None:
    """Run the command; SIGTERM and SIGHUP end it as Ctrl-C does, unless they are ignored, as under nohup."""
    watchdog = end_on_request()
    if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")  # as stderr shows letters that it does not have
    try:
        app()
    except SystemExit as end:
        watchdog.exit_code = end.code if isinstance(end.code, int) else None
        raise
    except (Exception, KeyboardInterrupt):
        # compiled extensions raise errors of their own for KeyboardInterrupt; a second one comes while a command ends
        if not watchdog.has_interrupted():
            raise
        typer.echo("interrupted", err=True)
        watchdog.exit_code = EXIT_CODE
        sys.exit(EXIT_CODE)
