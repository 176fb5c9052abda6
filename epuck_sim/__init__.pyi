from . import figures
from .embodied.simulation import Simulation
from .embodied.step import Step
from .errors import (
    ClusterError,
    ControllerError,
    EpuckSimError,
    FilmError,
    MeasureError,
    RecordingError,
    ScenarioError,
    StoreError,
)
from .figures.report import write_report
from .overhead.filming import film_trial
from .overhead.render import ArenaView
from .page.writer import Page, write_page
from .particles.simulation import Event, ParticleSimulation
from .recording.reader import read_recording, show
from .recording.recorder import record
from .runs.reader import read_points
from .scenario.embodied import EmbodiedScenario
from .scenario.loader import Point, load_scenario, points, write_scenario
from .scenario.particles import ParticleScenario
from .scenario.scenario import Scenario
from .statistics.statistic import summarize
from .sweep.run import run_sweep
from .trial.embodied import start_like
from .trial.model import run_trial
from .trial.result import TrialResult
from .trial.trace import Trace

__all__ = [
    "ArenaView",
    "ClusterError",
    "ControllerError",
    "EmbodiedScenario",
    "EpuckSimError",
    "Event",
    "FilmError",
    "MeasureError",
    "Page",
    "ParticleScenario",
    "ParticleSimulation",
    "Point",
    "RecordingError",
    "Scenario",
    "ScenarioError",
    "Simulation",
    "Step",
    "StoreError",
    "Trace",
    "TrialResult",
    "figures",
    "film_trial",
    "load_scenario",
    "points",
    "read_points",
    "read_recording",
    "record",
    "run_sweep",
    "run_trial",
    "show",
    "start_like",
    "summarize",
    "write_page",
    "write_report",
    "write_scenario",
]

__version__: str
