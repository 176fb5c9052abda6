"""Simulations for tests: with any scenario, with a state set by hand, or compared with the naive model."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st

from epuck_sim.arrays import IntArray
from epuck_sim.particles.motion import begin_motion
from epuck_sim.particles.oscillators import forget_earliest
from epuck_sim.particles.simulation import ParticleSimulation
from tests.particles.naive_model import NaiveModel

TOO_CLOSE = 1e-11  # relative margin below which a decision may go either way, because the kernel rounds differently

UNLIKELY = 1e-4
"""The p-value below which a sample does not fit: seeds are fixed, and what is wrong gives far less than this."""

BY_POSITION = ("nearest", "range", "cone_of_vision", "cone_of_emission", "all")
KINDS = (*BY_POSITION, "random")


def scenario(**sections: Any) -> dict[str, Any]:
    """Return the mapping of a particle scenario without a threshold of synchrony, unless `stop` sets one."""
    stop = {"order_parameter": None, **sections.pop("stop", {})}
    return {"model": "particles", "name": "test", "stop": stop, **sections}


def make_simulation(seed: int = 0, **sections: Any) -> ParticleSimulation:
    return ParticleSimulation(scenario(**sections), seed)


def set_trajectories(swarm: ParticleSimulation, positions, headings=None) -> None:
    """Set positions and headings, both (agents, dimensions), of a fresh simulation; headings are normalised."""
    arrays = swarm._arrays
    arrays.origin[:] = np.array(positions, float).T
    if headings is not None:
        given = np.array(headings, float)
        arrays.heading[:] = (given / np.linalg.norm(given, axis=1, keepdims=True)).T
    begin_motion(arrays.block)


def make_resting(phases, positions=None, headings=None, **sections: Any) -> ParticleSimulation:
    """Return a simulation of agents that stand still and are all neighbours, unless `sections` say otherwise."""
    dimensions = len(positions[0]) if positions else 2
    still = {"space": {"dimensions": dimensions}, "agents": {"count": len(phases), "speed_cm_s": 0}}
    swarm = make_simulation(**{**still, "neighbourhood": {"kind": "all"}, **sections})
    swarm._arrays.next_firing[:] = (1 - np.array(phases, float)) * swarm._arrays.period
    forget_earliest(swarm._arrays)
    if positions:
        set_trajectories(swarm, positions, headings)
    return swarm


MOTION = ("origin", "heading", "speed", "start_cycle", "start_time", "end_cycle", "end_time", "streams")


def state_of(swarm: ParticleSimulation) -> bytes:
    """Return all bits of the state, whichever cycle times are counted from."""
    swarm.positions()  # continues trajectories that have ended
    arrays = swarm._arrays
    cycles, times = np.divmod(arrays.next_firing, 1.0)
    found = [cycles + arrays.scene.cycle, times, arrays.period, *(getattr(arrays, name) for name in MOTION)]
    return b"".join(array.tobytes() for array in found)


def as_set(agents: IntArray) -> set[int]:
    """Return the agents of an event as a set, after checking that none is listed twice."""
    assert len(set(agents.tolist())) == len(agents)
    return set(agents.tolist())


def compare_events(swarm: ParticleSimulation, twin: NaiveModel, cycles: float, tolerance: float = 1e-7) -> int:
    """Compare a simulation with the naive model for some cycles, event by event; return the firings compared.

    It ends early at a decision that rounding may change, and when rounding errors have grown to a hundredth of the
    tolerance, as they do when an agent moves along a wall or when phases amplify them. Mistakes appear at once.
    """
    firings, grown = 0, 0.0
    side = swarm.scenario.space.side_cm
    while twin.time < cycles and grown < tolerance / 100:
        expected = twin.step()
        if expected.margin < TOO_CLOSE:
            break
        event = next(swarm)
        assert event.turned == expected.turned
        assert as_set(event.fired) == expected.fired
        assert as_set(event.received) == expected.received
        late = abs(event.time_s / swarm.scenario.clocks.period_s - expected.time)
        apart = np.abs(swarm.positions() - np.array(twin.positions)) / side
        if swarm.scenario.space.boundary == "cyclic":
            apart = np.minimum(apart, np.abs(1 - apart))  # 0 and the side are one place
        out = max_phase_difference(swarm.phases(), twin.phases)
        turned = np.abs(swarm.headings() - np.array(twin.headings)).max()
        grown = max(late, out, apart.max(), turned)
        assert grown < tolerance
        assert swarm.cycles == twin.cycles
        assert swarm.is_synchronised == twin.is_synchronised
        assert (swarm.order_parameter is None) == (twin.order is None)
        if twin.order is not None:
            assert abs(swarm.order_parameter - twin.order) < tolerance
        firings += len(expected.fired)
    return firings


def max_phase_difference(some: Sequence[float], others: Sequence[float]) -> float:
    """Return the largest difference between phases; 0 and 1 are the same phase."""
    difference = np.abs(np.asarray(some) - np.asarray(others))
    return float(np.minimum(difference, 1 - difference).max())


# --- any scenario -----------------------------------------------------------------------------------

lengths = st.floats(0.05, 1.6).map(lambda share: round(share, 3))
"""Radii as a share of the side: from a few neighbours at most to all agents."""


def rules(kind: str, agents: int, side_cm: float) -> st.SearchStrategy[Mapping[str, Any]]:
    radii = lengths.map(lambda share: share * side_cm)
    if kind in ("nearest", "random"):
        return st.fixed_dictionaries({"kind": st.just(kind), "k": st.integers(1, agents - 1)})
    if kind == "range":
        return st.fixed_dictionaries({"kind": st.just(kind), "radius_cm": radii})
    if kind == "all":
        return st.just({"kind": kind})
    angles = st.sampled_from([3.0, 20.0, 77.0, 130.0, 179.0, 181.0, 250.0, 340.0, 359.0, 360.0])
    return st.fixed_dictionaries({"kind": st.just(kind), "radius_cm": st.none() | radii, "angle_deg": angles})


def curve(name: str, couplings: list[float], refractory: list[float], **parameters: list[float]) -> st.SearchStrategy:
    section = {"coupling": st.sampled_from(couplings), "refractory": st.sampled_from(refractory)}
    if parameters:
        values = {key: st.sampled_from(each) for key, each in parameters.items()}
        section["parameters"] = st.fixed_dictionaries(values)
    return st.fixed_dictionaries({"curve": st.just(name), **section})


responses = st.one_of(
    curve("multiplicative", [0.0, 0.02, 0.1, 0.1, 0.3, 2.0], [0.0, 0.1, 0.45]),
    curve("sawtooth", [0.0, 0.1, 0.5, 0.83, 1.0], [0.0, 0.2, 0.49]),
    curve("sine", [0.0, 0.1, 0.5, 0.83, 1.0], [0.0, 0.2, 0.49]),
    curve("additive", [0.0, 0.03, 0.2, 1.0], [0.0, 0.2]),
    curve("mirollo_strogatz", [0.0, 0.03, 0.2, 1.0], [0.0, 0.2], dissipation=[0.1, 1.0, 3.0, 12.0]),
    curve("piecewise_linear", [0.1, 0.5], [0.0, 0.2], knee=[0.1, 0.47, 0.8], early_slope=[-3.0, -1.0, 0.0, 0.4]),
)

SPREADS = {"uniform": 0.5, "normal": 0.4, "lognormal": 1.5}
DISTRIBUTIONS = [{"speed_distribution": name, "speed_spread": spread} for name, spread in SPREADS.items()]
DISTRIBUTIONS += [{"speed_distribution": "two_speeds", "fast_share": 0.3, "fast_ratio": 10}]
speeds = st.sampled_from([{}, {"speed_distribution": "exponential"}, *DISTRIBUTIONS])

RANDOM_WALKS = (
    {"kind": "brownian"},
    {"kind": "correlated", "persistence": 0.7},
    {"kind": "correlated", "persistence": 1.0},
    {"kind": "levy", "exponent": 1.3},
    {"kind": "levy", "exponent": 3.0},
)


@st.composite
def walks(draw: st.DrawFn, period_s: float) -> dict[str, Any]:
    """Return a walk, straight more often than not, with runs from a tenth of a period to ten."""
    if draw(st.booleans()):
        return {"kind": "straight"}
    return {**draw(st.sampled_from(RANDOM_WALKS)), "run_s": period_s * draw(st.sampled_from([0.1, 1.0, 10.0]))}


PULSES = st.lists(st.sampled_from(["emitting", "receiving", "arriving"]), max_size=2, unique=True)


@st.composite
def any_sections(draw: st.DrawFn, kind: str, most_agents: int = 7) -> dict[str, Any]:
    """Return the sections of any scenario with this kind of neighbourhood."""
    agents = draw(st.integers(2, most_agents))
    side_cm = draw(st.sampled_from([1.0, 17.0, 100.0]))
    period_s = draw(st.sampled_from([1.0, 0.3, 4.0]))
    speed, walk = draw(speeds), draw(walks(period_s))
    is_redrawn = bool(speed) and walk["kind"] != "straight" and draw(st.booleans())
    pace = draw(st.sampled_from([0.0, 0.003, 0.03, 0.3, 1.1, 4.0]))  # sides in a cycle
    motion = {"speed_cm_s": pace * side_cm / period_s, **speed, "walk": walk, "speed_per_run": is_redrawn}
    boundary = draw(st.sampled_from(["bounded", "bounded", "cyclic", "mirrored"]))
    metric, reference = draw(st.sampled_from(["complex", "reference"])), draw(st.integers(0, agents - 1))
    threshold = draw(st.sampled_from([None, 0.3, 0.9, 1 - 1e-9]))
    return {
        "space": {"dimensions": draw(st.integers(1, 3)), "side_cm": side_cm, "boundary": boundary},
        "agents": {"count": agents, "reorient_on": draw(PULSES), **motion},
        "neighbourhood": draw(rules(kind, agents, side_cm)),
        "response": draw(responses),
        "clocks": {"period_s": period_s, "jitter": draw(st.sampled_from([0.0, 0.0, 1e-3, 0.2]))},
        "stop": {"metric": metric, "reference": reference, "order_parameter": threshold},
    }


WHOLE = ("ring_dead", "oscillator_frozen", "camera_blind", "wheels_dead", "restart")
"""Kinds of faults that have no strength."""


@st.composite
def fault_lists(draw, sections):
    """Return two faults that fit the sections, each with its times."""
    period_s, agents = sections["clocks"]["period_s"], sections["agents"]["count"]
    found = []
    for _ in range(2):
        kinds = [{"kind": kind} for kind in WHOLE if kind != "wheels_dead" or not sections["agents"]["speed_per_run"]]
        kinds += [{"kind": "clock_drift", "rate": rate} for rate in (0.5, 1.01, 3)]
        far = {"missed": 0.7, "farther_than_cm": sections["space"]["side_cm"] / 4}
        kinds += [{"kind": "camera_misses", **each} for each in ({"missed": 0.5}, far)]
        fault = draw(st.sampled_from(kinds)) | {"at_s": round(draw(st.floats(0, 4)), 3) * period_s}
        first = int(fault["kind"] == "oscillator_frozen")  # if all are frozen, nothing happens any more
        whom = st.lists(st.integers(first, agents - 1), min_size=1, unique=True)
        fault["agents"] = draw(whom if first else st.none() | whom)
        if fault["kind"] != "restart" and draw(st.booleans()):
            fault["until_s"] = fault["at_s"] + round(draw(st.floats(0.01, 3)), 3) * period_s
        found.append(fault)
    return found
