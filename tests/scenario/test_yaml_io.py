"""YAML is read as people mean it, and what no scenario is gets refused."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.yaml_io import MAX_BYTES, parse_yaml, read_yaml


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1E3", 1000.0),
        (".5", 0.5),
        ("-2.", -2.0),
        ("12", 12),
        ("010", 10),
        ("+3", 3),
        ("true", True),
        ("False", False),
        ("no", "no"),
        ("off", "off"),
        ("12:30", "12:30"),
        ("0x10", "0x10"),
        ("null", None),
        ("~", None),
        ("", None),
        ("[1, 2.5, a]", [1, 2.5, "a"]),
        ("{a: {b: 1}}", {"a": {"b": 1}}),
    ],
)
def test_plain_words_and_numbers_mean_what_they_look_like(text: str, value: object) -> None:
    result = parse_yaml(text, "here")
    assert result == value
    assert type(result) is type(value)


def test_aliases_and_merge_keys_work() -> None:
    text = "base: &base {x: 1, y: 2}\nother: {<<: *base, y: 3}"
    assert parse_yaml(text, "here")["other"] == {"x": 1, "y": 3}


def test_files_that_cannot_be_read_are_named(tmp_path) -> None:
    with pytest.raises(ScenarioError, match=r"gone\.yaml: cannot be read: No such file"):
        read_yaml(tmp_path / "gone.yaml")
    with pytest.raises(ScenarioError, match="cannot be read: Is a directory"):
        read_yaml(tmp_path)
    path = tmp_path / "huge.yaml"
    with path.open("wb") as file:
        file.truncate(100 * MAX_BYTES)
    with pytest.raises(ScenarioError, match="larger than 1 MB"):
        read_yaml(path)
    path = tmp_path / "latin.yaml"
    path.write_bytes(b"name: caf\xe9")
    with pytest.raises(ScenarioError, match="is not UTF-8 text"):
        read_yaml(path)
