"""Graphs of who hears whom, chains of phases, pairs and predictions, against slow twins, closed forms and trials."""

import csv
import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from epuck_sim import ParticleSimulation, Simulation, load_scenario, run_trial
from epuck_sim.estimate import Estimate
from epuck_sim.particles.phase_response import Response
from epuck_sim.theory import snapshots
from epuck_sim.theory.chains import Limit, find_limit, find_rise, judge, measure_pair, time_at
from epuck_sim.theory.predict import predict, predict_points
from epuck_sim.theory.snapshots import changed_links, count_components, measure_graphs, take_snapshots
from tests.cli.commands import called, read

any_links = st.integers(2, 6).flatmap(lambda n: arrays(np.bool_, (3, n, n)))
graphs = any_links.map(lambda found: found & ~np.eye(found.shape[1], dtype=bool))
MULTIPLICATIVE = Response(0, 0.1, 0.0)
THRESHOLD = 1 - 1e-9


@given(graphs)
def test_components_are_who_reach_each_other_and_degrees_and_sources_are_counted_agent_by_agent(snapshots) -> None:
    """Components without a way in are reached by nobody else."""
    components, without_way_in = count_components(snapshots)
    for links, found, closed in zip(snapshots, components, without_way_in, strict=True):
        reach = np.eye(len(links), dtype=bool) | links  # who reaches whom, by powers of the matrix
        for _ in range(len(links)):
            reach = reach @ reach
        both = reach & reach.T
        kinds = {tuple(np.flatnonzero(row)) for row in both}
        assert found == len(kinds)
        others = [[agent for agent in range(len(links)) if agent not in kind] for kind in kinds]
        assert closed == sum(not reach[np.ix_(rest, kind)].any() for rest, kind in zip(others, kinds, strict=True))
    measured = measure_graphs(snapshots)
    count, agents, _ = snapshots.shape
    deaf = [(g, a) for g in range(count) for a in range(agents) if not snapshots[g, :, a].any()]
    heard = [(g, a) for g, a in deaf if snapshots[g, a].any()]
    assert measured.sources.value == pytest.approx(len(heard) / (count * agents))
    assert measured.links.value == pytest.approx(snapshots.sum() / (count * agents))
    assert measured.frustrated.value + measured.joined.value == pytest.approx(1)


def test_links_of_agents_are_those_of_their_simulation_and_are_reciprocal_as_they_should_be() -> None:
    """Of random points in a plane, 6 pi / (8 pi + 3 sqrt 3) are nearest to their nearest (Clark and Evans 1955)."""
    scenario = load_scenario("particles", ["agents.count=7", "neighbourhood={kind: cone_of_vision, angle_deg: 90}"])
    snapshots = take_snapshots(scenario, 3)
    for snapshot, seed in zip(snapshots, range(3), strict=True):
        assert (snapshot == ParticleSimulation(scenario, seed).adjacency()).all()
    within = load_scenario("particles", ["neighbourhood={kind: range, radius_cm: 30}"])
    assert measure_graphs(take_snapshots(within, 20)).reciprocity.value == 1
    nearest = load_scenario("particles", ["space.boundary=cyclic", "agents.count=40"])
    found = measure_graphs(take_snapshots(nearest, 300)).reciprocity
    assert found.low - 0.01 < 6 * math.pi / (8 * math.pi + 3 * math.sqrt(3)) < found.high + 0.01


def test_robots_see_whom_the_observers_of_a_trial_see_and_radio_reaches_whoever_is_in_range_through_bodies() -> None:
    scenario = load_scenario("thesis")
    (snapshot,) = take_snapshots(scenario, 1)
    views = {(seen, looks) for _, looks, seen in Simulation(scenario, seed=0).stretch(1).views}
    links = {(sender, receiver) for sender, receiver in np.argwhere(snapshot)}
    assert len(links) > 3
    assert len(views ^ links) <= 2  # they have moved for a step
    everybody = load_scenario("thesis", ["robots.0.signal={kind: radio}"])
    assert take_snapshots(everybody, 2).sum() == 2 * 10 * 9
    near = load_scenario("thesis", ["robots.0.signal={kind: radio, range_cm: 20}"])
    assert measure_graphs(take_snapshots(near, 20)).reciprocity.value == 1


ABSENT = ", {count: 20, present: false}"


def test_the_faster_swarms_move_the_more_links_change_and_the_fewest_where_they_stand() -> None:
    for name in ("particles", "thesis"):
        changed = changed_links(load_scenario(name), [0.0, 0.2, 1.0, 5.0], 20)
        assert changed[0] == 0
        assert (np.diff(changed) > 0).all()
    wide = ["arena.width_cm=120", "arena.height_cm=120"]
    swarms = (load_scenario("thesis", [*wide, f"robots=[{{count: 20}}{more}]"]) for more in ("", ABSENT))
    there, and_others = (changed_links(swarm, [1.0], 20)[0] for swarm in swarms)
    assert and_others == pytest.approx(there, rel=0.2)
    pair, poses = load_scenario("thesis", [*wide, "robots=[{count: 2}]"]), [[[119, 50, 0], [2, 118, 3 * math.pi / 4]]]
    turned = snapshots._moved(pair, np.array(poses), math.sqrt(32))  # one beyond a wall, one beyond two
    assert turned == pytest.approx(np.array([[[121 - math.sqrt(32), 50, math.pi], [2, 118, -math.pi / 4]]]))


def simulated(settings: list[str], trials: int) -> tuple[float, float]:
    """Return the mean T_sync of trials, and its standard error."""
    simulation = ParticleSimulation(load_scenario("particles", settings), 0)
    times = []
    for seed in range(trials):
        simulation.reset(seed)
        times.append(run_trial(simulation).t_sync_cycles)
    return float(np.mean(times)), float(np.std(times) / math.sqrt(trials))


@pytest.mark.parametrize("curve", ["multiplicative", "sawtooth"])
def test_links_that_are_new_at_each_instant_are_receivers_drawn_for_each_pulse(curve: str) -> None:
    settings = ["agents.count=8", "neighbourhood={kind: random, k: 2}", f"response.curve={curve}"]
    mean, error = simulated(settings, 150)
    response = MULTIPLICATIVE if curve == "multiplicative" else Response(1, 0.1, 0.0)
    snapshots = take_snapshots(load_scenario("particles", settings), 400)
    found = find_limit(response, THRESHOLD, snapshots, 0.0, chains=200)
    assert found.ended.value == 1
    reach = 3 * math.hypot(error, (found.cycles.high - found.cycles.value) / 2)
    assert found.cycles.value == pytest.approx(mean, abs=reach)


def test_links_that_stay_are_those_of_agents_that_stand_and_what_none_joins_never_ends() -> None:
    settings = ["agents.count=6", "agents.speed_cm_s=0", "neighbourhood={kind: range, radius_cm: 142}"]
    mean, error = simulated(settings, 150)
    snapshots = take_snapshots(load_scenario("particles", settings), 10)
    found = find_limit(MULTIPLICATIVE, THRESHOLD, snapshots, math.inf, chains=200)
    assert found.cycles.value == pytest.approx(mean, abs=3 * math.hypot(error, found.cycles.value / 30))
    assert found.cycles.high - found.cycles.value == pytest.approx(1.96 * error * math.sqrt(150 / 200), rel=0.25)
    apart = np.zeros((1, 3, 3), np.bool_)
    apart[0, 0, 1] = True
    found = find_limit(MULTIPLICATIVE, THRESHOLD, apart, math.inf, chains=2)
    assert found.ended.value == 0
    assert math.isnan(found.cycles.value)
    assert math.isnan(find_limit(MULTIPLICATIVE, THRESHOLD, apart[:0], math.inf).cycles.value)  # without a snapshot


def test_pairs_grow_and_meet_as_their_curve_says() -> None:
    pair = measure_pair(MULTIPLICATIVE, THRESHOLD)
    assert (pair.lead, pair.lag) == (pytest.approx(math.log(1.1)), -math.inf)
    assert pair.growth == pytest.approx(math.log(1.1**2 / 2))
    sawtooth = measure_pair(Response(1, 0.1, 0.0), 0.99)
    assert (sawtooth.lead, sawtooth.lag) == (pytest.approx(math.log(0.9)), pytest.approx(math.log(0.9)))
    assert sawtooth.growth == pytest.approx(2 * math.log(0.9))
    settings = ["count=2", "speed_cm_s=0", "neighbourhood={kind: all}", "coupling=0.3", "refractory=0.3"]
    mean, error = simulated(settings, 1000)
    assert measure_pair(Response(0, 0.3, 0.3), THRESHOLD).cycles == pytest.approx(mean, abs=3 * error)
    assert measure_pair(Response(0, 0.0, 0.0), THRESHOLD).cycles == math.inf


def test_a_rise_is_from_a_slower_swarm_to_a_faster_one_and_decides_and_t_sync_lies_between_those_of_two_holds() -> None:
    def limit(hold: float, cycles: float, error: float = 1.05) -> Limit:
        return Limit(hold, Estimate(cycles, cycles / error, cycles * error), Estimate(1.0), cycles)

    holds = (8.0, 4.0, 2.0, 1.0, 0.0)
    rise = find_rise([*map(limit, holds, (200.0, 20.0, 400.0, 30.0, 20.0))])
    assert (rise.minimum, rise.peak) == (4.0, 2.0)
    assert rise.log_ratio == pytest.approx(math.log(20), abs=0.1)
    falling = [*map(limit, holds, (200.0, 80.0, 40.0, 30.0, 60.0))]
    assert find_rise(falling).log_ratio == 0  # that of the fast limit is none
    assert judge(rise).verdict == "yes"
    assert judge(find_rise(falling)).verdict == "no"
    course = [*map(limit, (8.0, 4.0, 0.0), (100.0, 25.0, 10.0))]
    assert time_at(course, math.sqrt(32)).value == pytest.approx(50)
    assert time_at(course, 16.0).value == pytest.approx(200)
    assert time_at(course, 1.0).value == 10


def of_agents(*settings: str):
    return predict(load_scenario("particles", ["agents.count=10", *settings]))


def test_swarms_have_the_regime_that_trials_find_and_where_they_find_it() -> None:
    """As docs/neighbour_change.md and docs/theory.md have them; speeds within a factor of 3."""
    for settings, verdict, v_p in [
        ((), "yes", 2.2),
        (("neighbourhood={kind: cone_of_vision, angle_deg: 60, radius_cm: 142}",), "yes", 3.45),
        (("neighbourhood={kind: cone_of_emission, angle_deg: 60, radius_cm: 142}",), "no", None),
        (("neighbourhood.k=2",), "no", None),
        (("neighbourhood.k=2", "agents.count=24", "response.coupling=0.2"), "yes", 1.1),
        (("response.curve=sawtooth",), "no", None),
    ]:
        found = of_agents(*settings)
        assert found.intermediate_regime.verdict == verdict
        if v_p is not None:
            assert v_p / 3 < found.v_p_cm_s.value < v_p * 3


def test_a_users_curve_is_taken_as_it_is_and_speeds_are_in_lengths_a_period(tmp_path) -> None:
    (tmp_path / "curve.py").write_text("def phase_shift(phase, coupling, parameters):\n    return coupling * phase\n")
    own, shipped = of_agents(f"response.curve={tmp_path / 'curve.py'}", "clocks.period_s=2"), of_agents()
    assert own.t_sync_fast == shipped.t_sync_fast
    assert own.pair == shipped.pair
    assert 2 * own.v_p_cm_s.value == pytest.approx(shipped.v_p_cm_s.value)


def test_receivers_drawn_for_each_pulse_and_robots_by_a_radio_that_all_receive_have_no_regime_at_any_speed() -> None:
    found = of_agents("neighbourhood={kind: random, k: 2}")
    assert (found.intermediate_regime.verdict, found.intermediate_regime.probability) == ("no", 0)
    assert found.t_sync == found.t_sync_fast
    assert "any speed" in found.reason
    found = predict(load_scenario("thesis", ["robots.0.signal={kind: radio}"]))
    assert (found.graph.joined.value, found.graph.reciprocity.value) == (1, 1)
    assert found.intermediate_regime.verdict == "no"
    assert "reaches all" in found.reason


def test_what_is_left_out_is_said() -> None:
    schedule = [{"at_cycle": 5, "set": {"agents.speed_cm_s": 3}}]
    given = {"model": "particles", "schedule": schedule, "agents": {"count": 5}, "start": {"phases": "synchronised"}}
    notes = " ".join(predict(load_scenario(given)).notes)
    assert "schedule is left out" in notes
    assert "start is left out" in notes
    changes = ["robots=[{count: 2}, {count: 3, parameters: {coupling: 0.3, speed_cm_s: 1}}]", "stop.metric=reference"]
    notes = " ".join(predict(load_scenario("thesis", changes)).notes)
    assert "groups differ in coupling, speed_cm_s" in notes
    assert "stop.metric is left out" in notes
    assert "misses the regime that trials of thesis have" in notes
    alone = predict(load_scenario({**given, "neighbourhood": {"kind": "range", "radius_cm": 0.01}}))
    assert "renewed links do not join them either" in alone.reason
    assert "poses are as given" in " ".join(predict("pair").notes)


def test_points_that_differ_in_speed_alone_share_what_does_not_depend_on_it() -> None:
    sweep = load_scenario("particles", ["agents.count=6"], ["agents.speed_cm_s=0,1,30"])
    (still, slow, fast) = [prediction for _, prediction in predict_points(sweep)]
    assert still.graph is slow.graph is fast.graph
    assert slow.link_cycles == pytest.approx(30 * fast.link_cycles)
    assert slow.t_sync.value > fast.t_sync.value
    assert still.notes == ()
    # a link is gone when agents have moved ten times as far as until a tenth of the links is others
    alone = load_scenario("particles", ["agents.count=6"])
    (changed,) = changed_links(alone, [slow.link_cm / 10 / alone.clocks.period_s], 60)
    assert changed == pytest.approx(2 * 0.1 / 1.1, abs=0.02)


def test_the_command_prints_a_table_an_object_or_a_row_a_point() -> None:
    words = ("predict", "particles", "--set", "count=6")
    assert "V_p, peak of T_sync" in called(*words)
    printed = read(*words)
    assert printed["intermediate_regime"].keys() == {"verdict", "probability"}
    assert printed["graph"]["links"]["value"] == 1
    rows = read(*words, "--sweep", "speed_cm_s=1,30")["points"]
    assert [row["axes"] for row in rows] == [{"agents.speed_cm_s": 1}, {"agents.speed_cm_s": 30}]
    assert "V_p, peak of T_sync (cm/s) -" in called(*words, "--sweep", "speed_cm_s=1,30")
    header, *lines = csv.reader(called(*words, "--sweep", "speed_cm_s=1,30", "--csv").splitlines())
    assert (len(lines), "" in header) == (2, False)
    lines = list(csv.reader(called(*words, "--csv").splitlines()))
    assert {tuple(line[2:]) for line in lines if line[0] == "link lasts"} == {("", "", "cm"), ("", "", "cycles")}
    assert {len(line) for line in lines} == {5}
