"""The command, called in this process."""

import json
import re
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import Any

from typer import testing

from epuck_sim.cli.app import app

testing._get_command = cache(testing._get_command)  # which builds all commands and their options anew at each call


def call(*arguments: str | Path, env: dict[str, str] | None = None):
    return testing.CliRunner().invoke(app, [*map(str, arguments)], env=env)


def without_progress(stderr: str) -> str:
    """Return what a command says, without what it adds on a busy machine, or where nothing is compiled yet."""
    return re.sub(r"^(compiled|trial \d+ of \d+: cycle) .*\n", "", stderr, flags=re.M)


def called(*arguments: str | Path, env: dict[str, str] | None = None) -> str:
    """Return what a command prints that ends well and has nothing to complain of."""
    result = call(*arguments, env=env)
    assert (result.exit_code, without_progress(result.stderr)) == (0, ""), result.exception or result.stderr
    return result.stdout


def read(*arguments: str | Path) -> Any:
    return json.loads(called(*arguments, "--json"))


def set_to(*settings: str) -> list[str]:
    return [word for setting in settings for word in ("--set", setting)]


def refused(*arguments: str | Path) -> str:
    """Return the line that a command ends with which prints nothing else."""
    result = call(*arguments)
    assert result.exit_code == 2, result.exception or result.stderr
    assert result.stdout == ""
    said = without_progress(result.stderr)
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    return said


def trials(stdout: str) -> list[dict[str, Any]]:
    """Return the trials of a command's JSON, without the time they took."""
    return [{**json.loads(line), "wall_s": 0} for line in stdout.splitlines()]


def cells(stdout: str) -> list[list[str]]:
    """Return the cells of all rows of all tables."""
    lines, found = stdout.splitlines(), []
    for number, line in enumerate(lines):
        if re.fullmatch(r"-+(  -+)*", line):
            spans = [match.span() for match in re.finditer("-+", line)]
            gaps = [end for _, end in spans[:-1]]
            rows = takewhile(lambda row: row.strip(), lines[number + 1 :])
            for row in rows:
                if not all(row[gap : gap + 2].isspace() for gap in gaps):  # a note below the table
                    break
                found.append([row[start:end].strip() for start, end in spans])
    return found


def write_scene(folder: Path, controller: str, max_time_s: float) -> Path:
    (folder / "mine.py").write_text(controller)
    path = folder / "scene.yaml"
    path.write_text(f"name: mine\nrobots: [{{controller: mine.py, count: 1}}]\nstop: {{max_time_s: {max_time_s}}}\n")
    return path


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def contents(folder: Path) -> dict[str, bytes | None]:
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}
