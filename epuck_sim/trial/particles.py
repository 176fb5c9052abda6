"""One trial of point agents: a simulation that runs until it is synchronised, or up to its limit."""

import time
from collections.abc import Sequence

from epuck_sim.errors import EpuckSimError
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.trial.measuring import Measuring
from epuck_sim.trial.result import Observer, Progress, TrialResult
from epuck_sim.util.messages import BY_OBSERVER
from epuck_sim.util.native import working_s

SLICE_S = 0.02  # wall time for which compiled code runs before it returns to Python, for Ctrl-C and for progress
FIRST_SLICE = 100_000  # number of agents that pulses of the first slice may reach; takes milliseconds in any swarm


def run_agents(
    simulation: ParticleSimulation, observers: Sequence[Observer], progress: Progress | None, measuring: Measuring
) -> TrialResult:
    """Run a fresh simulation of point agents to the end of its trial; see `trial.model.Model.run`.

    Without observers, compiled code runs for about `SLICE_S` at a time, which is much quicker. A slice is a number of
    pulses: their cost hardly changes as the swarm synchronises, unlike that of an instant or a period. It also ends at
    the next firing of the reference if measures need it, when a batch of firings is full that measures take, and at a
    firing that an entry of the schedule waits for. A trial that ends at a time ends there exactly.
    """
    if simulation.instants:
        said = f"in this one, agents have fired at {simulation.instants} instants"
        raise ValueError(f"a trial needs a fresh simulation; {said}")
    stop, period_s = simulation.scenario.stop, simulation.scenario.clocks.period_s
    limit = stop.max_cycles
    longest = 2 * limit  # periods, after which a trial ends whose reference is held back for ever by others
    end_s = longest * period_s if stop.max_time_s is None else min(longest * period_s, stop.max_time_s)
    is_timed = end_s == stop.max_time_s
    periods, share = divmod(end_s / period_s, 1.0)
    end = (int(periods), share) if is_timed else (longest, 0.0)
    if measuring.at_batches:
        simulation.record()
    began = working_s()
    pulses = max(1, FIRST_SLICE // simulation.scenario.agents.count)

    def has_ended() -> bool:
        return simulation.is_synchronised or simulation.cycles >= limit or measuring.is_over()

    while not has_ended():
        measuring.carry_out(simulation, simulation.carry_out_scheduled)
        if simulation.next_firing > end and simulation.next_change > end:
            break
        cycles = simulation.cycles
        event = next(simulation) if observers else None
        if not observers:
            asked = time.perf_counter()
            # progress shows order parameters, which are measured only at firings of the reference
            is_one_cycle = bool(measuring.at_cycles) or (progress is not None and simulation.order_parameter is None)
            most = 1 if is_one_cycle else len(simulation.room) or limit
            last_cycle = min(limit, measuring.next_cycle, cycles + most)
            simulation.run(last_cycle, end[0] - simulation.period, pulses, share=end[1])
            took = time.perf_counter() - asked
            if took > 2 * SLICE_S:
                pulses = max(1, pulses // 2)
            elif took < SLICE_S / 2 and simulation.cycles < last_cycle:
                pulses *= 2  # a slice that ended at a firing does not show how long a whole one takes
        now_s, is_cycle = simulation.time_s, simulation.cycles > cycles
        for observer in observers:
            observer(event, simulation)
        if is_cycle:
            _tell(measuring, simulation)
        if simulation.time_s != now_s:
            raise EpuckSimError(BY_OBSERVER)
        if progress is not None:
            progress(simulation)
    is_early = has_ended()
    if is_timed and not is_early:
        simulation.run_to(end_s)
    # where the reference was held back until the end, no firing ended the trial
    has_order = is_early or is_timed
    is_known = simulation.is_synchronised or (stop.gives_t_sync and measuring.is_over())
    return TrialResult(
        scenario=simulation.scenario.name,
        seed=simulation.seed,
        t_sync_cycles=simulation.cycles if is_known else None,
        censored=not is_known if stop.has_t_sync else None,
        cycles=simulation.cycles,
        order_parameter=simulation.order_parameter if has_order else None,
        steps=simulation.instants,
        simulated_s=simulation.time_s if has_order else end_s,
        wall_s=working_s() - began,
        events=tuple(simulation.events),
    )


def _tell(measuring: Measuring, simulation: ParticleSimulation) -> None:
    """Tell measures of the cycles that were taken."""
    if measuring.at_batches:
        batch = simulation.take_batch()
        for tell in measuring.at_batches:
            tell(batch, simulation)
    if measuring.at_cycles:
        event = simulation.last_instant()
        for observer in measuring.at_cycles:
            observer(event, simulation)
