"""Claims about the motion of chapter 3: straight ahead, and a turn at once away from walls."""

import math

import numpy as np
import pytest

from epuck_sim import Simulation, run_trial

ARENA = {"width_cm": 100, "height_cm": 100}
AHEAD = {"controller": "constant", "parameters": {"left_cm_s": 5, "right_cm_s": 5}}


def swarm(group, **sections) -> Simulation:
    return Simulation({"arena": ARENA, "noise": "off", "robots": [group], **sections}, 5)


def reorienting(**sections) -> dict[str, object]:
    return {"controller": "reorientation", "infrared": {"robots": False}, **sections}


def test_a_robot_turns_to_within_90_degrees_of_the_normal_of_a_wall_that_it_meets():
    poses = [[90.0, 5.0 + 9 * place, 0.0] for place in range(1, 10)]
    simulation, found = swarm(reorienting(poses=poses)), []
    before = np.zeros(9)
    for _ in range(30):
        step = simulation.advance(1)
        turned = np.abs(step.poses[:, 2] - before) > 1e-12
        found.extend(step.poses[turned & (step.poses[:, 0] > 90), 2])
        before = step.poses[:, 2].copy()
    angles = np.array(found) % (2 * math.pi) - math.pi  # from the normal of the right wall
    assert len(angles) >= 9
    assert (np.abs(angles) <= math.pi / 2 + 1e-9).all()
    assert angles.min() < -0.5 < 0.5 < angles.max()


def test_a_robot_goes_straight_ahead_between_walls_and_never_touches_one():
    simulation = swarm(reorienting(count=5))
    poses = np.array([simulation.advance(1).poses.copy() for _ in range(2000)])
    moved = np.diff(poses, axis=0)
    assert poses[..., :2].min() > 3.7
    assert poses[..., :2].max() < 100 - 3.7
    straight = moved[:-1][np.abs(moved[:-1, :, 2]) < 1e-12]
    way = np.hypot(straight[:, 0], straight[:, 1])
    assert np.median(way) == pytest.approx(1.28)
    assert len(straight) > 0.8 * moved[..., 2].size


@pytest.mark.parametrize(("robots", "x_cm", "off_cm"), [(False, [50, 30], 1e-9), (True, [40 - 3.7, 40 + 3.7], 0.1)])
def test_robots_that_do_not_touch_pass_through_each_other_but_not_through_walls(robots, x_cm, off_cm):
    poses = [[30.0, 50.0, 0.0], [50.0, 50.0, math.pi], [90.0, 10.0, 0.0]]
    step = swarm({"poses": poses, **AHEAD}, contact={"robots": robots}).advance(41)
    np.testing.assert_allclose(step.poses[:2, 0], x_cm, atol=off_cm)
    assert step.poses[2, 0] == pytest.approx(100 - 3.7, abs=0.1)


def test_robots_of_chapter_3_synchronise_fast_when_they_see_far_and_all_around():
    group = {
        "count": 20,
        "controller": "reorienting_firefly",
        "parameters": {"period_s": 8, "flash_fraction": 0.0375, "refractory_fraction": 0.1},
        "infrared": {"robots": False},
    }
    stop, cycles = {"metric": "reference", "max_cycles": 200}, []
    for signal in ({"kind": "cone"}, {"kind": "cone", "range_cm": 10, "angle_deg": 30}):
        trial = run_trial(Simulation({"arena": ARENA, "robots": [{**group, "signal": signal}], "stop": stop}, 4))
        cycles.append(trial.t_sync_cycles if trial.t_sync_cycles is not None else 200)
    assert cycles[0] < 30 < cycles[1]
