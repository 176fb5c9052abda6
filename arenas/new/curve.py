"""A response curve of point agents; run it with: epuck-sim run particles --set response.curve=NAME.py

It runs as it stands: the later a pulse arrives in the cycle, the farther it shifts the phase. Change what you need.
"""

# Name to default; a scenario sets them as response: {curve: NAME.py, parameters: {bend: 3}}.
PARAMETERS = {"bend": 2.0}


# Called at each pulse: `phase` is from above the refractory period to 1, `coupling` the scenario's.
# Return the shift of the phase; a phase beyond 1 fires. It is compiled, and must depend on its arguments only.
def phase_shift(phase, coupling, parameters):
    return coupling * phase**parameters.bend
