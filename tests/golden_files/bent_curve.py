"""A response curve with parameters of its own."""

PARAMETERS = {"bend": 2.0, "times": 1}


def phase_shift(phase, coupling, parameters):
    """Shift a phase the more, the further it is."""
    return coupling * phase**parameters.bend * parameters.times
