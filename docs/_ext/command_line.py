"""Writes the reference of all commands and options from the command line itself."""

from collections.abc import Iterator, Mapping
from typing import Any

import typer

from epuck_sim.cli.app import app


def write_commands() -> str:
    """Return the reference as Markdown: a section for each command, with a table for each panel of options."""
    group: Any = typer.main.get_command(app)
    return "\n\n".join(_write_commands(group.commands, "epuck-sim"))


def _write_commands(commands: Mapping[str, Any], program: str) -> Iterator[str]:
    for name, command in commands.items():
        yield f"## `{program} {name}`"
        yield command.help
        if hasattr(command, "commands"):
            yield from (
                part.replace("## ", "### ", 1) for part in _write_commands(command.commands, f"{program} {name}")
            )
        else:
            yield from _write_parameters([each for each in command.params if not getattr(each, "hidden", False)])


def _write_parameters(parameters: list[Any]) -> Iterator[str]:
    panels = dict.fromkeys(each.rich_help_panel or "" for each in parameters)
    for panel in panels:
        yield f"**{panel}**" if panel else ""
        shown = [each for each in parameters if (each.rich_help_panel or "") == panel]
        rows = [f"| {_write_name(each)} | {_in_markdown(each.help or '')} |" for each in shown]
        yield "\n".join(["| | |", "| --- | --- |", *rows])


def _write_name(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        name = parameter.metavar or parameter.name.upper()
        name += "..." * (parameter.nargs != 1)
        return f"`{name}`" if parameter.required else f"`[{name}]`"
    names = ", ".join(parameter.opts)
    return f"`{names}`" if parameter.is_flag else f"`{names} {parameter.metavar or parameter.name.upper()}`"


def _in_markdown(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")
