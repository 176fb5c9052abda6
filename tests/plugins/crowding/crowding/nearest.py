"""How close robots come to each other."""

import numpy as np


def nearest_robot(simulation, *, most_cm=1000.0):
    """Mean distance of robots to the nearest other one at the end of a trial, cm."""
    places = simulation.last_step.poses[:, :2]
    distances = np.linalg.norm(places[:, None] - places[None], axis=-1)
    np.fill_diagonal(distances, most_cm)
    return float(distances.min(axis=1).mean())
