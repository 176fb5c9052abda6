"""What recording costs: time of a step, bytes of a minute, memory. Run by `make bench`."""

import time
from itertools import islice

import pytest

from epuck_sim import Simulation, record
from epuck_sim.recording import Level
from epuck_sim.trial.embodied import SynchronyWatch
from tests.benchmarks.measuring import resident_kb, swarm_of

SWARMS = {10: (60, 6000), 100: (221, 3000), 1000: (700, 600)}  # robots: side of their arena in cm, steps

COLUMNS = "robots", "level", "us a step", "over the step", "kB a minute", "ms an empty one"


@pytest.mark.parametrize("level", Level)
@pytest.mark.parametrize("robots", SWARMS)
def test_a_step_and_a_minute(show, tmp_path, robots: int, level: Level) -> None:
    """CPU time of all threads, but for that of the simulation itself and of a recording with nothing in it."""
    file, (side_cm, steps) = tmp_path / "t.rrd", SWARMS[robots]

    def recording_and_simulating_s(steps: int) -> tuple[float, float]:
        simulation = Simulation(swarm_of(robots, side_cm), 1)
        watch = SynchronyWatch(simulation)
        simulating = 0.0
        began = time.process_time()
        with record(file, simulation.scenario, 1, level) as recorder:
            for _ in range(steps):
                stepping = time.thread_time()
                step = next(simulation)
                watch.look(step, is_firing=simulation.is_firing)
                simulating += time.thread_time() - stepping
                recorder(step, watch)
        return time.process_time() - began - simulating, simulating

    recording_and_simulating_s(1)
    empty_s, empty = min(recording_and_simulating_s(0)[0] for _ in range(3)), file.stat().st_size
    found = [recording_and_simulating_s(steps) for _ in range(3)]
    minute_kb = (file.stat().st_size - empty) / 1000 / (steps / 600)
    recording_s, simulating_s = (min(column) for column in zip(*found, strict=True))
    added_s = recording_s - empty_s
    show(COLUMNS, robots, level, added_s / steps * 1e6, added_s / simulating_s, minute_kb, 1e3 * empty_s)


def test_ten_hours(tmp_path) -> None:
    simulation = Simulation("thesis", 1)
    watch = SynchronyWatch(simulation)
    resident = []
    with record(tmp_path / "t.rrd", simulation.scenario, 1) as recorder:
        for _ in range(10):
            for step in islice(simulation, 36_000):
                watch.look(step, is_firing=simulation.is_firing)
                recorder(step, watch)
            resident.append(resident_kb() / 1024)
    size_mb = (tmp_path / "t.rrd").stat().st_size / 1e6
    print(f"\nten hours: {size_mb:.0f} MB; memory after each hour: {', '.join(f'{mb:.0f}' for mb in resident)} MB")
    assert resident[-1] <= 1.1 * resident[0]
