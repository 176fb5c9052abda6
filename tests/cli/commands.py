"""The command, called in this process."""

from pathlib import Path

from typer.testing import CliRunner

from epuck_sim.cli.app import app


def call(*arguments: str | Path):
    return CliRunner().invoke(app, [*map(str, arguments)])


def called(*arguments: str | Path) -> str:
    """Return what a command prints that ends well and has nothing to complain of."""
    result = call(*arguments)
    assert (result.exit_code, result.stderr) == (0, ""), result.exception
    return result.stdout


def refused(*arguments: str | Path) -> str:
    """Return the line that a command ends with which prints nothing else."""
    result = call(*arguments)
    assert result.exit_code == 2, result.exception or result.stderr
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    return result.stderr


def contents(folder: Path) -> dict[str, bytes | None]:
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}
