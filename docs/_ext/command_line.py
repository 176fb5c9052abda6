"""Writes the reference of all commands and options from the command line itself."""

from collections.abc import Iterator
from typing import Any

import typer

from epuck_sim.cli.app import app


def write_commands() -> str:
    """Return the reference as Markdown: a section for each command, with a table for each panel of options."""
    group: Any = typer.main.get_command(app)
    return "\n\n".join(part for name, command in group.commands.items() for part in _write_command(name, command))


def _write_command(name: str, command: Any) -> Iterator[str]:
    yield f"## `epuck-sim {name}`"
    yield command.help
    yield from _write_parameters([each for each in command.params if not getattr(each, "hidden", False)])


def _write_parameters(parameters: list[Any]) -> Iterator[str]:
    panels = dict.fromkeys(each.rich_help_panel or "" for each in parameters)
    for panel in panels:
        yield f"**{panel}**" if panel else ""
        shown = [each for each in parameters if (each.rich_help_panel or "") == panel]
        rows = [f"| {_write_name(each)} | {_in_markdown(each.help or '')} |" for each in shown]
        yield "\n".join(["| option | meaning |", "| --- | --- |", *rows])


def _write_name(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        name = parameter.metavar or parameter.name.upper()
        name += "..." * (parameter.nargs != 1)
        return f"`{name}`" if parameter.required else f"`[{name}]`"
    names = ", ".join(parameter.opts)
    return f"`{names}`" if parameter.is_flag else f"`{names} {parameter.metavar or parameter.name.upper()}`"


def _in_markdown(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")
