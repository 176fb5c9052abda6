"""The command, called in this process."""

from pathlib import Path

from typer.testing import CliRunner

from epuck_sim.cli import app


def call(*arguments: str | Path):
    return CliRunner().invoke(app, [*map(str, arguments)])


def refused(*arguments: str | Path) -> str:
    """Return the line that a command ends with which prints nothing else."""
    result = call(*arguments)
    assert result.exit_code == 2, result.exception or result.stderr
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    return result.stderr
