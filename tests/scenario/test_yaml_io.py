"""YAML is read as people mean it, and what no scenario is gets refused."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.yaml_io import MAX_BYTES, parse_yaml, read_yaml


def test_plain_words_and_numbers_mean_what_they_look_like() -> None:
    text = "[1e-3, 1E3, .5, -2., 12, 010, +3, true, False, no, off, 12:30, 0x10, null, ~, a, [2.5], {b: 1}]"
    values = [0.001, 1000.0, 0.5, -2.0, 12, 10, 3, True, False, "no", "off", "12:30", "0x10", None, None, "a"]
    assert repr(parse_yaml(text, "here")) == repr([*values, [2.5], {"b": 1}])
    assert parse_yaml("", "here") is None


def test_aliases_and_merge_keys_work() -> None:
    text = "base: &base {x: 1, y: 2}\nother: {<<: *base, y: 3}"
    assert parse_yaml(text, "here")["other"] == {"x": 1, "y": 3}


def test_files_that_cannot_be_read_are_named(tmp_path) -> None:
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
