"""One table of mistakes that users make, `mistakes.yaml`: what is typed or written, and what is said of it.

A row has `says`, parts of the message with ... between them, and what is wrong:

- `scenario`: keys of a scenario, which `check` reads from a file, `s.yaml`; or `text`, the file itself
- `command`: words after `epuck-sim`; that of a row with a scenario is `check s.yaml`
- `files`: further files by their names, beside the scenario
- `code`: the exit code, if it is not 2
"""

import re
import shlex
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from epuck_sim.cli.app import app
from epuck_sim.scenario.yaml_io import parse_yaml, write_yaml

TABLE = Path(__file__).with_name("mistakes.yaml")


@cache
def rows() -> list[dict[str, Any]]:
    parts = TABLE.read_text(encoding="utf-8").split("\n# ")
    return [row for part in parts for row in parse_yaml(f"# {part}", str(TABLE)) or ()]


@pytest.mark.parametrize("row", rows(), ids=lambda row: row["says"][:70])
def test_a_mistake_ends_the_command_with_one_message_before_anything_runs(row, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in row.get("files", {}).items():
        Path(name).write_text(text, encoding="utf-8")
    if "scenario" in row or "text" in row:
        Path("s.yaml").write_text(row["text"] if "text" in row else write_yaml(row["scenario"]), encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    result = CliRunner().invoke(app, shlex.split(row.get("command", "check s.yaml")))
    assert result.exit_code == row.get("code", 2), result.output
    said = " ".join(result.stderr.replace("│", " ").split())
    parts = (re.escape(" ".join(part.split())) for part in row["says"].split("..."))
    assert re.search(".*".join(parts), said), said
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    assert sorted(tmp_path.iterdir()) == before
