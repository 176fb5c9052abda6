"""Simulate swarms of e-puck robots that synchronise like fireflies.

Scenarios: `load_scenario`, `points`. Simulations: `Simulation` of robots with bodies, `ParticleSimulation` of point
agents. Trials: `run_trial`, with `record`, `film_trial` and `Trace` as observers; `read_recording`. Sweeps:
`run_sweep`, `read_points`, `summarize`. Every error that is raised on purpose is an `EpuckSimError`.

>>> import epuck_sim
>>> epuck_sim.load_scenario("thesis").robots[0].count
10
"""

import lazy_loader

from epuck_sim.errors import extras_named

__version__ = "0.2.0.dev0"

# `epuck-sim --help` must not wait for numba: names are imported when they are first used; __init__.pyi lists them
_find, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = extras_named()(_find)
