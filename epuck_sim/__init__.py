"""Swarms of e-puck robots that synchronise like fireflies."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from epuck_sim.embodied.simulation import Simulation as Simulation
    from epuck_sim.embodied.step import Step as Step
    from epuck_sim.errors import ClusterError as ClusterError
    from epuck_sim.errors import ControllerError as ControllerError
    from epuck_sim.errors import EpuckSimError as EpuckSimError
    from epuck_sim.errors import RecordingError as RecordingError
    from epuck_sim.errors import ScenarioError as ScenarioError
    from epuck_sim.errors import StoreError as StoreError
    from epuck_sim.particles.simulation import Swarm as Swarm
    from epuck_sim.recording.reader import read_recording as read_recording
    from epuck_sim.recording.recorder import record as record
    from epuck_sim.runs.reader import read_points as read_points
    from epuck_sim.scenario.loader import load_scenario as load_scenario
    from epuck_sim.scenario.points import points as points
    from epuck_sim.scenario.scenario import Scenario as Scenario
    from epuck_sim.statistics.summary import summarize as summarize
    from epuck_sim.sweep.run import run_sweep as run_sweep
    from epuck_sim.trial.embodied import TrialResult as TrialResult
    from epuck_sim.trial.embodied import run_trial as run_trial
    from epuck_sim.trial.particles import run_swarm as run_swarm

__version__ = "0.1.0"

_HOMES = {
    "ClusterError": "errors",
    "ControllerError": "errors",
    "EpuckSimError": "errors",
    "RecordingError": "errors",
    "Scenario": "scenario.scenario",
    "ScenarioError": "errors",
    "Simulation": "embodied.simulation",
    "Step": "embodied.step",
    "StoreError": "errors",
    "Swarm": "particles.simulation",
    "TrialResult": "trial.embodied",
    "load_scenario": "scenario.loader",
    "points": "scenario.points",
    "read_points": "runs.reader",
    "read_recording": "recording.reader",
    "record": "recording.recorder",
    "run_swarm": "trial.particles",
    "run_sweep": "sweep.run",
    "run_trial": "trial.embodied",
    "summarize": "statistics.summary",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for: `epuck-sim --help` must not wait for numba."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
