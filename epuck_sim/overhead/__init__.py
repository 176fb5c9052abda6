"""The camera above the arena (thesis 4.3): the tracker of flashes in any film, and films of trials.

A program beside the simulator. `render`, `filming` and `compare` may import recording, trial, the models and scenario;
of these, the other modules import only the section `overhead` of scenarios, which describes a camera. No module imports
runs, sweep or statistics. A map is in docs/architecture.md.
"""

ROUNDING = 1e-9  # largest difference of equal quantities of films and trials, relative to them
