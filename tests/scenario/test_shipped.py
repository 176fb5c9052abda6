"""What holds for every shipped scenario, in its full and its quick version."""

import re

import pytest

from epuck_sim.scenario.axes import check_figure_axes
from epuck_sim.scenario.loader import SCENARIO, complete, load_scenario, write_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.yaml_io import parse_yaml, read_yaml
from tests.cli.commands import call

HAS_QUICK = {name: "quick" in read_yaml(path) for name, path in SCENARIO.shipped().items()}
MANY = 60
"""Number of points above which a sweep's are looked at by the slow tests alone."""


def flat(value, prefix="") -> list[str]:
    """Return the dotted keys of nested mappings and of sections in lists."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    parts = [(f"{prefix}{name}", each) for name, each in items if isinstance(value, dict) or isinstance(each, dict)]
    return [key for name, each in parts for key in (name, *flat(each, f"{name}."))]


def versions():
    for name, has_quick in HAS_QUICK.items():
        for quick in [False, True][: 1 + has_quick]:
            sweep = load_scenario(name, quick=quick).sweep
            is_long = sweep is not None and sweep.point_count > MANY
            yield pytest.param(name, quick, id=f"{name}-quick" if quick else name, marks=[pytest.mark.slow] * is_long)


@pytest.mark.parametrize(("name", "quick"), [*versions()])
def test_a_shipped_scenario_is_checked_written_and_read_again_and_its_figure_is_of_its_axes(name, quick) -> None:
    scenario = load_scenario(name, quick=quick)
    printed = call("check", name, *["--quick"] * quick)
    assert printed.exit_code == 0
    assert printed.stderr in ("", f"checking {name} takes a while; Ctrl-C ends it\n")  # on a busy machine
    assert printed.stdout.startswith(write_scenario(scenario))
    written = parse_yaml(printed.stdout, "stdout")
    assert load_scenario(written) == complete(scenario, name) == scenario  # and so are its points
    found = points(scenario)
    assert len(found) == (scenario.sweep.point_count if scenario.sweep else 1)
    keys = set(scenario.all_keys(written))
    assert {key for key in flat(written) if not re.match(r"sweep|measures|robots\.\d+\.poses\.", key)} <= keys
    for point in found:
        assert (point.scenario.sweep, point.scenario.name) == (None, scenario.name)
        assert set(point.axes) == set(scenario.sweep.keys if scenario.sweep else ())
    if scenario.sweep is None:
        return
    figure, axes = scenario.figure, scenario.sweep.keys
    named = [key for key in (figure.x, figure.y, figure.panels) if key is not None]
    assert set(named) <= set(axes)
    assert len(set(named)) == len(named)
    check_figure_axes(figure, [point.axes for point in found])
    assert (figure.y is not None) <= (figure.form == "map")
    assert (figure.panels is not None) <= (figure.form == "curves")
    assert (figure.censored_at_cycles is not None) <= (figure.form == "violins")
    if figure.form in ("perturbation", "course"):
        assert isinstance(scenario, ParticleScenario)
        assert (scenario.start.phases, scenario.stop.order_parameter) == ("synchronised", None)


def test_all_sweeps_of_particles_have_a_quick_version() -> None:
    shipped = map(load_scenario, HAS_QUICK)
    sweeps = [each.name for each in shipped if each.sweep and each.model == "particles"]
    assert len(sweeps) >= 15
    assert [name for name in sweeps if not HAS_QUICK[name]] == []


def test_a_quick_version_is_less_of_the_same_figure_with_the_same_trials() -> None:
    for name in (name for name, has_quick in HAS_QUICK.items() if has_quick):
        full, quick = load_scenario(name), load_scenario(name, quick=True)
        assert full != quick
        assert (quick.name, quick.description, quick.seed) == (full.name, full.description, full.seed)
        assert quick.sweep.keys == full.sweep.keys, name
        assert quick.sweep.point_count <= full.sweep.point_count, name
        assert (quick.trials, quick.stop.max_cycles) <= (full.trials, full.stop.max_cycles), name
        assert quick.figure.model_copy(update={"censored_at_cycles": full.figure.censored_at_cycles}) == full.figure
        alone = [each.model_copy(update={"sweep": None}).model_dump() for each in (full, quick)]
        changed = {part for part in alone[0] if alone[0][part] != alone[1][part]}
        assert changed <= {"stop", "trials", "figure", "agents"}, name
