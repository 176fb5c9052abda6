"""Science: the three regimes of thesis Fig. 4.2; claims of docs/open_questions.md, in shorter or fewer trials
than behind the docs; and the comparison with other simulators, which finds what differs and nothing else."""

import math

import numpy as np
import pytest

from docs import validation
from docs.validation import LEVEL, PEERS, compare_point, compare_table, findings, main
from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.statistics.statistic import Measured, cut
from epuck_sim.util.seeds import trial_seed


def synchronisation_times(speed_cm_s: float, trials: int) -> np.ndarray:
    scenario = load_scenario("thesis", [f"robots.0.parameters.speed_cm_s={speed_cm_s}"])
    results = [run_trial(Simulation(scenario, trial_seed(0, trial))) for trial in range(trials)]
    assert not any(result.censored for result in results)
    return np.array([result.t_sync_cycles for result in results])


def gap_in_standard_errors(longer: np.ndarray, shorter: np.ndarray) -> float:
    error = (longer.var(ddof=1) / len(longer) + shorter.var(ddof=1) / len(shorter)) ** 0.5
    return (longer.mean() - shorter.mean()) / error


def test_slow_robots_take_longer_than_medium_ones_and_those_longer_than_fast_ones() -> None:
    slow, medium, fast = (synchronisation_times(speed, 30) for speed in (0.05, 0.376, 12.8))
    assert gap_in_standard_errors(slow, medium) > 2
    assert gap_in_standard_errors(medium, fast) > 2


@pytest.mark.slow
def test_at_intermediate_speed_they_take_longer_than_at_a_lower_and_at_a_higher_one() -> None:
    lower, intermediate, higher = (synchronisation_times(speed, 1000) for speed in (0.376, 1.029, 2.821))
    assert gap_in_standard_errors(intermediate, lower) > 2
    assert gap_in_standard_errors(intermediate, higher) > 2


def test_robots_that_switch_come_together_at_once_again_after_a_push_and_are_slow():
    push = [{"at_cycle": 120, "displace": {"robots": [5, 6, 7, 8, 9], "by_cycles": 0.5}}]
    scenario = load_scenario("thesis", ["robots.0.controller=switching"], measures=["order_parameter", "mean_speed"])
    stop = scenario.stop.model_copy(update={"order_parameter": None, "max_cycles": 240})
    scenario = load_scenario({**scenario.model_dump(), "stop": stop.model_dump(), "schedule": push})
    result = run_trial(Simulation(scenario, seed=1))
    order = np.array(result.measures["order_parameter"], float)
    assert order[100:120].min() >= 0.95
    assert order[120:123].min() < 0.5
    assert order[-20:].min() >= 0.95
    assert result.measures["mean_speed"] < 6


@pytest.mark.parametrize("speed", [0.5, 12.8])
def test_where_all_hear_all_a_swarm_may_be_locked_out_of_phase_for_ever(speed):
    """Nine robots fire within a step of each other, and push one as far ahead as it pushes them."""
    phases = [800, 2504, 800, 800, 800, 800, 900, 800, 800, 800]
    settings = ["robots.0.signal={kind: radio}", f"robots.0.memory={{phase_ms: {phases}}}", f"speed_cm_s={speed}"]
    simulation = Simulation(load_scenario("thesis", settings), seed=1)
    period = next(steps for steps in range(1, 100) if simulation.advance(1).phase_ms.tolist() == phases)
    for _ in range(50):
        assert simulation.advance(period).phase_ms.tolist() == phases


def results(scenario, seeds):
    simulation = Simulation(scenario, seed=0)
    for seed in seeds:
        simulation.reset(seed)
        yield run_trial(simulation)


def test_robots_that_look_all_around_agree_on_a_word_at_once():
    def cycles(field_of_view_deg: float) -> int:
        view = [f"robots.0.camera.field_of_view_deg={field_of_view_deg}", "robots.0.parameters.speed_cm_s=0.5"]
        stop = ["stop.order_parameter=null", "stop.when=consensus >= 0", "stop.max_cycles=200"]
        scenario = load_scenario("thesis", [*view, *stop], measures=["consensus"])
        return sum(result.measures["consensus"] for result in results(scenario, range(3)))

    assert cycles(360) <= 6
    assert cycles(56) > 20


def test_kilobots_whose_messages_reach_7_cm_are_sooner_in_step_if_they_are_fast():
    def cycles(speed_cm_s: float) -> list[int | None]:
        settings = ["robots.0.signal.range_cm=7", f"robots.0.parameters.speed_cm_s={speed_cm_s}"]
        scenario = load_scenario("kilobots", [*settings, "stop.max_cycles=300"])
        return [result.t_sync_cycles for result in results(scenario, (1, 2))]

    assert cycles(1.0).count(None) == 0
    assert cycles(0.1) == [None] * 2


def test_robots_that_turn_every_second_are_sooner_in_step_than_those_that_go_straight():
    def cycles(persistence: float) -> float:
        walk = {"run_s": 1.0, "persistence": persistence, "speed_cm_s": 0.4}
        robots = [{"count": 10, "controller": "walking_firefly", "parameters": walk}]
        return float(np.mean([result.t_sync_cycles for result in results({"robots": robots}, range(12))]))

    assert cycles(0.0) < 0.75 * cycles(1.0)


LIMIT = 400.0


def sample(mean: float, trials: int, seed: int, limit: float = math.inf) -> Measured:
    times = np.ceil(mean * np.random.default_rng(seed).weibull(1.3, trials))
    return cut(Measured(times, np.ones(trials, bool), math.inf, seed), limit)


def table(factor: float, points: int = 60, limit: float = math.inf, odd: float = 1.0):
    """Return the comparison of samples whose means differ by a factor, and at the last point by another one."""
    factors = [factor] * (points - 1) + [factor * odd]
    pairs = [(sample(100, 60, n, limit), sample(100 * each, 60, 1000 + n, limit)) for n, each in enumerate(factors)]
    return compare_table(PEERS[0], [compare_point({"V": n}, *pair) for n, pair in enumerate(pairs)])


def test_equal_distributions_are_found_equal_their_z_is_normal_and_trials_at_the_limit_say_nothing() -> None:
    for limit in (math.inf, LIMIT / 4):
        overall = table(1, limit=limit)
        assert min(findings([overall])) > LEVEL
        assert overall.ratio.low < 1 < overall.ratio.high
    z = np.array([compare_point({}, sample(4, 15, n), sample(4, 20, 5000 + n)).z for n in range(400)])
    assert z.mean() == pytest.approx(0, abs=0.1)
    assert (z**2).mean() == pytest.approx(1, abs=0.15)
    same, other = sample(1e6, 20, 1, LIMIT), compare_point({}, sample(9, 9, 1), sample(9, 9, 2))
    assert compare_table(PEERS[0], [compare_point({}, same, same), other]).compared == 1


def test_a_shift_of_all_points_is_found_that_no_single_point_shows_and_one_point_that_differs() -> None:
    single, whole = findings([table(1.12)])
    assert single > LEVEL
    assert whole < LEVEL
    assert table(1.12).ratio.value == pytest.approx(1.12, abs=0.05)
    for limit in (math.inf, LIMIT / 4):
        assert findings([table(1, limit=limit, odd=3.0)])[0] < LEVEL
        assert ("log-rank" in table(1, 2, limit).points[0].p_values) == (limit < math.inf)


def test_tables_have_the_points_and_trials_that_their_page_names() -> None:
    assert [len(peer.read()) for peer in PEERS] == [72, 42, 213]
    assert [sum(map(len, peer.read())) for peer in PEERS] == [14_400, 630, 12_460]
    for peer in PEERS:
        for rows in peer.read():
            limit = peer.axes(rows[0])[validation.LIMIT]
            assert all(float(row["T_sync"]) == limit for row in rows if row["censored"] == "1")


@pytest.mark.slow
def test_nothing_is_found_at_a_tenth_of_the_points(tmp_path) -> None:
    assert main([str(tmp_path), "--every", "10"]) == 0
    assert "**No difference is found**" in (tmp_path / "validation.md").read_text()
    assert (tmp_path / "figures/validation.png").stat().st_size > 10_000
