"""A recording of point-like agents holds what an unrecorded twin does, and is read, drawn and shown correctly."""

from collections import Counter
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex

from epuck_sim import EpuckSimError, ParticleScenario, load_scenario, read_recording, run_trial
from epuck_sim.arrays import FloatArray
from epuck_sim.display.arena_svg import MOST_NUMBERED
from epuck_sim.figures.trial_page import draw_page
from epuck_sim.order_parameter import METRICS
from epuck_sim.overhead.filming import film_trial
from epuck_sim.particles.simulation import SHIFTS_ONLY, Event, ParticleSimulation
from epuck_sim.recording import Level, recorder, rows
from epuck_sim.recording.rerun import run_rerun
from epuck_sim.trial.model import simulate
from epuck_sim.util.yaml_io import parse_yaml
from tests.overhead.films import frames_and_description
from tests.particles.naive_model import receivers_of
from tests.recording.recordings import Found, recorded

GLOW, FRAMES = 0.075, 20

SCENARIOS: dict[str, dict[str, Any]] = parse_yaml(
    """
thesis: {agents: {speed_cm_s: 30}, stop: {max_cycles: 8}}
synchronises: {agents: {count: 5, speed_cm_s: 30}, neighbourhood: {kind: all}}
segment:
  space: {dimensions: 1, side_cm: 40}
  agents: {count: 9, speed_cm_s: 13}
  neighbourhood: {kind: cone_of_vision, angle_deg: 90, radius_cm: 15}
cyclic segment:
  space: {dimensions: 1, boundary: cyclic}
  agents: {count: 6, speed_cm_s: 80}
  neighbourhood: {kind: range, radius_cm: 20}
cyclic:
  space: {boundary: cyclic, side_cm: 50}
  agents: {count: 12, speed_cm_s: 40, reorient_on: [arriving]}
  neighbourhood: {kind: cone_of_vision, angle_deg: 100, radius_cm: 20}
  clocks: {jitter: 0.1}
  stop: {order_parameter: null, max_cycles: 6, metric: reference, reference: 3}
emitting:
  agents: {count: 15, speed_cm_s: 20, reorient_on: [emitting, receiving]}
  neighbourhood: {kind: cone_of_emission, angle_deg: 150}
  clocks: {period_s: 3.7}
  response: {refractory: 0.2}
cube:
  space: {dimensions: 3}
  agents: {count: 8, speed_cm_s: 20, speed_distribution: lognormal, speed_spread: 1, speed_per_run: true,
           walk: {kind: brownian, run_s: 0.4}}
  neighbourhood: {kind: cone_of_vision, angle_deg: 120}
cyclic cube:
  space: {dimensions: 3, boundary: cyclic}
  agents: {count: 10, speed_cm_s: 55}
  neighbourhood: {kind: nearest, k: 3}
in step:
  agents: {count: 4, speed_cm_s: 5}
  start: {phases: synchronised, displacement: 0.3}
  response: {curve: sine, coupling: 0.1}
changing:
  agents: {count: 6, speed_cm_s: 20}
  schedule:
  - {at_s: 2.5, set: {agents.speed_cm_s: 0}}
  - {at_s: 3.7, set: {agents.speed_cm_s: 20}, displace: {by_cycles: 0.3}}
like robots:
  space: {side_cm: 60}
  agents: {count: 10, speed_cm_s: 20}
  start: {like: thesis}
alone: {agents: {count: 1, speed_cm_s: 0}, neighbourhood: {kind: all}}
many:
  agents: {count: 180, speed_cm_s: 3}
  neighbourhood: {kind: range, radius_cm: 5}
  stop: {order_parameter: null, max_cycles: 2}
""",
    "scenarios",
)


def load(name: str, **more: Any) -> ParticleScenario:
    base = {"model": "particles", "name": name, "stop": {"order_parameter": None, "max_cycles": 6}}
    if name == "synchronises":
        del base["stop"]
    scenario = load_scenario({**base, **SCENARIOS[name], **more})
    assert isinstance(scenario, ParticleScenario)
    return scenario


@pytest.fixture(scope="module")
def of(tmp_path_factory) -> Any:
    """Return what makes a trial of a scenario, once, recorded and as it was watched without a recorder."""

    @cache
    def make(name: str) -> SimpleNamespace:
        scenario, path = load(name), tmp_path_factory.mktemp("recording") / "t.rrd"
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(recorder, "BUFFER_ROWS", 173)
            made = SimpleNamespace(scenario=scenario, path=path, result_recorded=recorded(path, scenario, 4))
        made.recorded, made.seen = read_recording(path), []

        def look(event: Event, swarm: ParticleSimulation) -> None:
            state = {name: getattr(swarm, name)() for name in ("phases", "positions", "headings")}
            state["order_parameter"] = swarm.order_parameter
            made.seen.append(SimpleNamespace(event=event, time_ns=round(event.time_s * 1e9), **state))

        made.result = run_trial(simulate(scenario, 4), [look])
        made.instants = [each for each in made.seen if len(each.event.fired)]
        made.time_ns = np.round(made.recorded.time_s * 1e9).astype(np.int64)
        made.places = np.searchsorted(made.time_ns, [each.time_ns for each in made.instants]).tolist()
        return made

    return make


@pytest.fixture(params=SCENARIOS)
def trial(request, of) -> SimpleNamespace:
    return of(request.param)


def flat(vectors: FloatArray) -> FloatArray:
    """Return (..., 2) what of (..., dimensions) is seen from above."""
    return np.concatenate([vectors, np.zeros((*vectors.shape[:-1], 2))], axis=-1)[..., :2]


def test_a_recorded_trial_is_the_same_trial_with_a_row_at_each_instant_and_20_in_each_period(trial) -> None:
    assert trial.result_recorded._replace(wall_s=0) == trial.result._replace(wall_s=0)
    read = trial.recorded
    assert (read.scenario, read.seed, read.level) == (trial.scenario, 4, Level.FULL)
    assert (read.cycles, read.synchronised) == (trial.result.cycles, trial.result.t_sync_cycles is not None)
    assert [time_s for time_s, _ in read.events] == pytest.approx([event.time_s for event in trial.result.events])
    run_rerun("rrd", "verify", str(trial.path))
    check_entities(trial.path, trial.scenario, Level.FULL)
    last = trial.seen[-1]
    frame_ns = trial.scenario.clocks.period_s * 1e9 / FRAMES
    frames = {round(number * frame_ns) for number in range(int(last.time_ns / frame_ns) + 2)}
    expected = {time for time in frames if time < last.time_ns} | {each.time_ns for each in trial.instants}
    assert trial.time_ns.tolist() == sorted(expected)


def test_a_trial_that_ends_at_a_time_is_recorded_and_filmed_to_it(tmp_path) -> None:
    stop, clocks = {"order_parameter": None, "max_time_s": 1.4}, {"period_s": 0.5}
    scenario = load("in step", stop=stop, clocks=clocks)  # agents fire at 1 s, and at 1.5 s
    with film_trial(tmp_path / "t.mp4", scenario, 4) as film:
        recorded(tmp_path / "t.rrd", scenario, 4, Level.FULL, film)
    assert read_recording(tmp_path / "t.rrd").time_s[-1] == 1.4
    assert len(frames_and_description(tmp_path / "t.mp4")[0]) == 1 + 35


def test_flashes_are_at_the_instants_to_the_nanosecond_and_the_order_is_the_one_that_decides(trial) -> None:
    counts, expected, read = Counter[int](), [], trial.recorded
    for each in trial.instants:
        for agent in sorted(each.event.fired.tolist()):
            counts[agent] += 1
            expected.append((each.time_ns / 1e9, agent, counts[agent]))
    assert list(zip(read.flash_s, read.flash_robot, read.flash_cycle, strict=True)) == expected
    reference = trial.scenario.stop.reference
    firings = [each for each in trial.instants if reference in each.event.fired]
    assert read.firing_s.tolist() == [each.time_ns / 1e9 for each in firings]
    assert read.firing_order.tolist() == [each.order_parameter for each in firings]
    assert len(firings) == trial.result.cycles
    at = np.searchsorted(read.time_s, read.firing_s)
    np.testing.assert_allclose(read.order_parameter[at], read.firing_order, rtol=0, atol=1e-12)


def test_all_is_as_the_swarm_had_it_and_between_instants_agents_fly_straight_and_phases_rise(trial) -> None:
    read, period_ms = trial.recorded, 1000 * trial.scenario.clocks.period_s
    twin, swarms = simulate(trial.scenario, 4), {}
    for row in sorted({*range(len(trial.time_ns))} - {*trial.places}):  # between instants
        twin.run_to(trial.time_ns[row] / 1e9)
        swarms[row] = twin.phases(), twin.positions(), twin.headings()
    assert len(swarms) > 15
    assert len(trial.instants) == trial.result.steps > 2
    for row, each in zip(trial.places, trial.instants, strict=True):
        np.testing.assert_array_equal(read.positions[row], flat(each.positions).astype(np.float32))
        np.testing.assert_array_equal(read.phase_ms[row], period_ms * each.phases)
        swarms[row] = each.phases, each.positions, each.headings
    for row, (phases, positions, headings) in swarms.items():
        atol = 1e-6 * trial.scenario.space.side_cm
        np.testing.assert_allclose(read.positions[row], flat(positions), rtol=0, atol=atol)
        np.testing.assert_allclose(read.phase_ms[row], period_ms * phases, atol=1e-5)
        stop = trial.scenario.stop
        since = phases - phases[stop.reference] if stop.metric == "reference" else phases
        assert read.order_parameter[row] == pytest.approx(METRICS[stop.metric](since, 1.0), abs=1e-7)
        turned = np.exp(1j * read.headings[row]) * (flat(headings) @ [1, -1j])
        np.testing.assert_allclose(np.angle(turned[turned != 0]), 0, atol=1e-5)


def test_agents_that_have_just_fired_are_lit(trial) -> None:
    expected = np.zeros_like(trial.recorded.ring_on)
    glow_ns = 1e9 * GLOW * trial.scenario.clocks.period_s
    for each in trial.instants:
        glows = (trial.time_ns >= each.time_ns) & (trial.time_ns < each.time_ns + glow_ns)
        for agent in each.event.fired:
            expected[glows, agent] = True
    np.testing.assert_array_equal(trial.recorded.ring_on, expected)
    assert expected.any()
    assert not expected.all()


def test_arrows_lead_from_agents_that_fire_to_those_that_receive_the_pulse(trial) -> None:
    found, side_cm = Found(trial.path), trial.scenario.space.side_cm
    parts = [found.lists("/arena/links", f"Arrows2D:{part}") for part in ("origins", "vectors", "class_ids")]
    assert np.round(np.array(found.times("/arena/links"))).tolist() == trial.time_ns.tolist()
    assert not any(parts[0][row] for row in set(range(len(trial.time_ns))) - {*trial.places})
    headings = {each.time_ns: before.headings for before, each in zip(trial.seen, trial.seen[1:], strict=False)}
    headings[trial.seen[0].time_ns] = simulate(trial.scenario, 4).headings()
    shifts, links = 0, []
    for row, each in zip(trial.places, trial.instants, strict=True):
        waits, expected = {*each.event.received.tolist()}, []
        for agent in each.event.fired.tolist():
            receives, _ = receivers_of(trial.scenario, each.positions, headings[each.time_ns], agent)
            reached = {*np.flatnonzero(receives).tolist()}
            for other in reached if trial.scenario.agents.count < SHIFTS_ONLY else reached & waits:
                way = each.positions[other] - each.positions[agent]
                if trial.scenario.space.boundary == "cyclic":
                    way -= side_cm * np.round(way / side_cm)
                expected.append((*flat(each.positions[agent]), *flat(way), other in waits))
                links.append([row, agent, other, other in waits])
            waits -= reached
        assert not waits
        shifts += len(each.event.received)
        drawn = [(*origin, *way, kind) for origin, way, kind in zip(*(part[row] for part in parts), strict=True)]
        shown, wanted = (np.array(sorted(arrows)).reshape(-1, 5) for arrows in (drawn, expected))
        np.testing.assert_allclose(shown, wanted, atol=1e-4 * side_cm)
    assert shifts or trial.scenario.name == "alone"
    assert sorted(trial.recorded.pulses.tolist()) == sorted(links)
    assert trial.recorded.pulses[:, :2].tolist() == [link[:2] for link in links]  # in the order of the cascade


def test_a_cone_is_drawn_from_its_agent_up_to_its_reach_or_the_walls_and_a_range_as_circles(of) -> None:
    for trial, half, longest in ((of("cyclic"), 50, 20), (of("emitting"), 75, 12.5)):
        read, side_cm = trial.recorded, trial.scenario.space.side_cm
        strips = Found(trial.path).array("/arena/cones", "LineStrips2D:strips").astype(float)
        for end in (0, -1):
            np.testing.assert_array_equal(strips[:, :, end], read.positions)
        arc = strips[:, :, 1:-1] - read.positions[:, :, None]
        lengths = np.linalg.norm(arc, axis=-1)
        beyond = np.maximum(-strips[:, :, 1:-1], strips[:, :, 1:-1] - side_cm).max(axis=-1)  # the nearest wall
        np.testing.assert_allclose(np.maximum(lengths - longest, beyond)[lengths > 1e-3], 0, atol=1e-3)
        turned = np.angle(np.exp(1j * (np.arctan2(arc[..., 1], arc[..., 0]) - read.headings[..., None])))
        corners = np.linspace(-half, half, arc.shape[2])
        far = lengths > 0.1
        assert far.mean() > 0.9
        np.testing.assert_allclose(np.degrees(turned)[far], np.broadcast_to(corners, far.shape)[far], atol=0.1)
    found = Found(of("cyclic segment").path)
    centers = found.array("/arena/ranges", "Ellipses2D:centers")
    np.testing.assert_array_equal(centers, of("cyclic segment").recorded.positions)
    assert found.static["/arena/ranges"]["Ellipses2D:half_sizes"] == [[20, 20]] * 6


def check_entities(path: Path, scenario: ParticleScenario, level: Level) -> None:
    kind, is_full, numbered = scenario.neighbourhood.kind, level is Level.FULL, range(scenario.agents.count)
    has_poses = level is not Level.SUMMARY
    there = {
        **dict.fromkeys(("/now", "/flashes", "/order/steps", "/order/firings"), True),
        **dict.fromkeys(("/phases", "/phase_lead", "/arena/robots", "/arena/headings"), has_poses),
        **{f"/arena/numbers/{n}": has_poses and len(numbered) < MOST_NUMBERED for n in numbered},
        "/arena/links": is_full,
        "/order/threshold": scenario.stop.order_parameter is not None,
        "/events": scenario.has_events,
        "/arena/ranges": is_full and kind == "range",
        "/arena/cones": is_full and kind.startswith("cone") and scenario.space.dimensions == 2,
    }
    assert set(Found(path).moving) == {entity for entity, is_there in there.items() if is_there}


@pytest.mark.parametrize("level", [Level.SUMMARY, Level.POSES])
@pytest.mark.parametrize("name", ["cyclic", "cyclic segment"])
def test_each_level_holds_what_it_should_and_no_more(tmp_path, of, name: str, level: Level) -> None:
    recorded(tmp_path / "t.rrd", load(name), 4, level)
    check_entities(tmp_path / "t.rrd", load(name), level)
    read, full = read_recording(tmp_path / "t.rrd"), of(name).recorded
    assert read.level is level
    for field in ("phase_ms", "positions", "headings", "ring_on"):
        found, expected = getattr(read, field), getattr(full, field)
        np.testing.assert_array_equal(found, expected[:0] if level is Level.SUMMARY else expected)


def test_what_cannot_be_recorded_is_refused_in_words(tmp_path, monkeypatch) -> None:
    assert np.iinfo(np.int64).max > rows.LATEST_S * 1e9
    monkeypatch.setattr(rows, "LATEST_S", 9e7)
    long = {"clocks": {"period_s": 1e6}, "stop": {"order_parameter": None, "max_cycles": 91}}
    for scenario, said in (
        (load("thesis", sweep={"grid": {"agents.count": [2, 3]}}), "thesis: is a sweep; "),
        (load("alone", **long), r"alone: lasts more than 9e\+07 s"),
    ):
        with pytest.raises(EpuckSimError, match=f"^{said}"):
            recorded(tmp_path / "t.rrd", scenario, level=Level.SUMMARY)
        assert not any(tmp_path.iterdir())


def test_paths_have_gaps_where_a_cyclic_space_is_left_and_go_up_in_time_in_a_segment(of) -> None:
    for trial in (of("cyclic"), of("cyclic cube")):
        arena, *_ = draw_page(trial.recorded).axes
        paths = [line for line in arena.get_lines() if to_hex(line.get_color()) != "#ffffff"]
        assert len(paths) == trial.scenario.agents.count
        steps = np.concatenate([np.diff(np.column_stack(line.get_data()), axis=0) for line in paths])
        assert np.isnan(steps).any()
        assert np.nanmax(np.abs(steps)) < trial.scenario.space.side_cm / 4
    read = of("segment").recorded
    arena, *_ = draw_page(read).axes
    assert (arena.get_xlabel(), arena.get_ylabel()) == ("x (cm)", "simulated time (s)")
    paths = [line for line in arena.get_lines() if len(line.get_xdata()) > 2]
    assert len(paths) == 9
    for agent, line in enumerate(paths):
        x, time_s = line.get_xdata(), line.get_ydata()
        is_row = np.isin(time_s, read.time_s)
        np.testing.assert_array_equal(x[is_row], read.positions[np.searchsorted(read.time_s, time_s[is_row]), agent, 0])
        assert np.isclose(x[~is_row, None], [0, read.scenario.space.side_cm], atol=1e-3).any(axis=1).all()  # at walls
