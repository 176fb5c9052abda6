"""Sightings and contacts that a step offers are those of its poses, and asking for them changes nothing."""

from itertools import islice

import numpy as np
import pytest

from epuck_sim.embodied.observers import find_contacts, find_sightings, make_scene
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.loader import load_scenario

CROWD = load_scenario(
    {
        "arena": {
            "width_cm": 70,
            "height_cm": 60,
            "obstacles": [
                {"shape": "circle", "x_cm": 20, "y_cm": 20, "radius_cm": 5},
                {"shape": "box", "x_cm": 45, "y_cm": 40, "width_cm": 12, "height_cm": 6, "heading_rad": 0.5},
            ],
        },
        "robots": [
            {"count": 8, "parameters": {"period_s": 1.5}},
            {"count": 8, "camera": {"pixels": 300, "field_of_view_deg": 360, "range_cm": 40}},
        ],
    }
)


def test_the_sightings_of_a_step_are_the_lit_ones_in_view() -> None:
    scene = make_scene(CROWD.robots, CROWD.group_kinds, CROWD.arena.build())
    lit, total = np.zeros(16, bool), 0
    for step in islice(Simulation(CROWD, 1), 200):
        expected = []
        for group in range(2):
            found = find_sightings(scene, step.poses[None].copy(), group)
            expected += [[looks, seen] for _, looks, seen in found.tolist() if lit[seen]]
        assert step.sightings.tolist() == expected
        total += len(expected)
        lit = step.ring_on.copy()
    assert total > 500


def test_who_sees_red_sees_somebody_lit() -> None:
    for step in islice(Simulation("thesis", 1), 300):
        assert set(step.sightings[:, 0].tolist()) == set(np.flatnonzero(step.camera.any(axis=1)).tolist())


def test_the_contacts_of_a_step_are_those_of_its_poses() -> None:
    scene = make_scene(CROWD.robots, CROWD.group_kinds, CROWD.arena.build())
    total = 0
    for step in islice(Simulation(CROWD, 1), 200):
        found, points = find_contacts(scene, step.poses[None].copy())
        assert step.contacts.tolist() == found[:, 1:].tolist()
        for (_, robot, other), point in zip(found, points, strict=True):
            if other >= 0:
                np.testing.assert_allclose(point, step.poses[[robot, other], :2].mean(axis=0))
            assert np.hypot(*(point - step.poses[robot, :2])) <= 3.7 + 0.16
        total += len(found)
    assert total > 20


@pytest.mark.parametrize("interpret", [False, True])
def test_asking_changes_nothing(interpret) -> None:
    steps = 150 if not interpret else 20
    asked, plain = Simulation("thesis", 3, interpret=interpret), Simulation("thesis", 3, interpret=interpret)
    for one, other in zip(islice(asked, steps), islice(plain, steps), strict=True):
        first = one.sightings
        assert one.sightings is first
        assert one.contacts.shape[1] == 2
        assert one.poses.tobytes() == other.poses.tobytes()
        assert one.camera.tobytes() == other.camera.tobytes()
