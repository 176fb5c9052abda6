"""Keys of scenarios that people type: by their endings, and ranges of values."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import with_ranges
from epuck_sim.scenario.base import guess
from epuck_sim.scenario.keys import axis_key, full_keys
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.scenario import WITHOUT_EFFECT

PLACES = {
    "thesis": {
        "speed_cm_s": "robots.0.parameters.speed_cm_s",
        "field_of_view_deg": "robots.0.camera.field_of_view_deg",
        "overhead.field_of_view_deg": "overhead.field_of_view_deg",
        "phase_ms": "robots.0.memory.phase_ms",
        "count": "robots.0.count",
        "light": "overhead.light",
    },
    "particles": {"speed_cm_s": "agents.speed_cm_s", "coupling": "response.coupling", "k": "neighbourhood.k"},
}
KEYS = {
    name: scenario.all_keys(scenario.model_dump(mode="json"))
    for name in ("thesis", "particles", "obstacles")
    for scenario in [load_scenario(name)]
}


def test_an_ending_stands_for_the_key_on_which_trials_depend() -> None:
    for name, places in PLACES.items():
        assert {typed: full_keys(typed, KEYS[name], "x") for typed in places} == {
            typed: [places[typed]] for typed in places
        }


@given(st.data())
def test_every_ending_of_a_key_stands_for_it_or_is_refused_with_it_among_the_candidates(data) -> None:
    keys = KEYS[data.draw(st.sampled_from(sorted(KEYS)))]
    key = data.draw(st.sampled_from(keys))
    parts = key.split(".")
    ending = ".".join(parts[data.draw(st.integers(0, len(parts) - 1)) :])
    try:
        found = full_keys(ending, keys, "x")
    except ScenarioError as refused:
        found = str(refused).rpartition("give one of ")[2].split(", ")
    has_effect = {each: each.partition(".")[0] not in WITHOUT_EFFECT for each in (key, *found)}
    is_second = not has_effect[key] and any(has_effect.values())
    assert key in found or is_second or ending in keys


def test_keys_of_sweeps_and_measures_are_not_typed_and_a_longer_name_goes_on_after_an_underscore() -> None:
    scenario = load_scenario({"measures": [{"near_walls": {"within_cm": 3}}]}, axes=["robots.0.count=2,3"])
    sections = {key.partition(".")[0] for key in scenario.all_keys(scenario.model_dump(mode="json"))}
    assert "robots" in sections
    assert not {"sweep", "measures"} & sections
    assert "did you mean side_cm (space.side_cm)?" in guess("side", [], ["space.sides", "space.side_cm"])


def test_an_ending_sets_what_its_key_sets_and_is_described_by_it() -> None:
    short = load_scenario("thesis", ["speed_cm_s=3", "camera.pixels=20"], ["count=2,3"])
    settings = ["robots.0.parameters.speed_cm_s=3", "robots.0.camera.pixels=20"]
    assert short == load_scenario("thesis", settings, ["robots.0.count=2,3"])


def test_an_ending_in_several_groups_means_all_of_them_and_says_so() -> None:
    groups = {"name": "two", "robots": [{"count": 2}, {"count": 3}]}
    with pytest.warns(UserWarning, match=r"speed_cm_s stands for robots\.0\.\S+ and robots\.1\.parameters\.speed_cm_s"):
        scenario = load_scenario(groups, ["speed_cm_s=3"])
    assert [group.parameters["speed_cm_s"] for group in scenario.robots] == [3, 3]
    with pytest.warns(UserWarning, match="stands for"):
        sweep = points(load_scenario(groups, axes=["speed_cm_s=1:4:2", "coupling=0.1,0.2", "0.count=4,5"]))
    assert len(sweep) == 8
    for point in sweep:
        first, second = (group.parameters for group in point.scenario.robots)
        assert (first["speed_cm_s"], first["coupling"]) == (second["speed_cm_s"], second["coupling"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_scenario(groups, ["0.count=3"])
    with pytest.warns(UserWarning, match="stands for"):
        again = points(load_scenario(groups, axes=["count=2,3", "coupling=0.1,0.2", "count=4,5"]))
    assert [point.axes["robots.1.count"] for point in again] == [4, 5, 4, 5]


def test_an_ending_in_several_groups_is_the_axis_of_the_first_where_they_are_alike() -> None:
    alike = [{"robots.0.count": count, "robots.1.count": count} for count in (2, 3)]
    for typed, key in {"count": "robots.0.count", "1.count": "robots.1.count", "k": "k"}.items():
        assert axis_key(typed, alike, "--x") == key
    with pytest.raises(ScenarioError, match=r"--x: count is the ending of 2 axes; give one of robots.0.count, "):
        axis_key("count", [*alike, {"robots.0.count": 2, "robots.1.count": 3}], "--x")


NUMBERS = st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: float(f"{value:.6g}"))


SCALES = st.sampled_from(["", ":lin", ":log"])


@given(NUMBERS, NUMBERS, st.integers(2, 50), SCALES, st.sampled_from(["a.x", "a.speed_cm_s"]))
def test_a_range_is_even_from_its_first_number_to_its_last(a, b, number, scale, key) -> None:
    low, high = sorted((a, b))
    text = f"{low!r}:{high!r}:{number}{scale}"
    is_log = scale == ":log" or (not scale and low > 0 and (key.endswith("speed_cm_s") or high >= 10 * low))
    if low == high or (is_log and low <= 0):
        with pytest.raises(ValueError, match="allowed: FROM:TO:NUMBER"):
            with_ranges(key, text)
        return
    values = np.array(with_ranges(key, text))
    assert (values[0], values[-1], len(values)) == (low, high, number)
    steps = np.diff(np.log(values) if is_log else values)
    assert np.allclose(steps, steps.mean(), atol=2e-5 * (1 if is_log else np.abs(values).max()))


def test_ranges_stand_beside_values_in_files_and_of_whole_numbers_are_whole() -> None:
    grid = {"robots.0.count": "5:20:4", "arena.width_cm": [50, "60:80:3:lin"]}
    sweep = load_scenario({"sweep": {"grid": grid}}).sweep
    assert sweep.grid == {"robots.0.count": (5, 10, 15, 20), "arena.width_cm": (50, 60, 70, 80)}
    assert all(isinstance(value, int) for value in sweep.grid["robots.0.count"])
