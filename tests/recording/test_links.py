"""Who was linked to whom is read back as it was, and a recording that does not hold it says so."""

from pathlib import Path

import numpy as np
import pytest

from epuck_sim import epuck
from epuck_sim.embodied.observers import GAP_CM, find_sightings, make_scene
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.errors import RecordingError
from epuck_sim.particles.links import LinkSearch
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.recording import Level
from epuck_sim.recording.reader import nearest, read_recording
from epuck_sim.recording.recorded import Recorded
from epuck_sim.recording.recorder import record
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial

CROWD = load_scenario(
    {
        "name": "crowd",
        "arena": {
            "width_cm": 70,
            "height_cm": 60,
            "obstacles": [{"shape": "circle", "x_cm": 35, "y_cm": 30, "radius_cm": 5}],
        },
        "robots": [{"count": 6}, {"count": 8, "camera": {"field_of_view_deg": 200, "pixels": 90}}],
        "stop": {"max_time_s": 25},
    }
)


def robots(path: Path, level: Level = Level.FULL) -> tuple[Recorded, list[Step]]:
    steps: list[Step] = []
    with record(path, CROWD, 4, level) as recorder:
        keep = lambda step, _: steps.append(step._replace(poses=step.poses.copy(), ring_on=step.ring_on.copy()))  # noqa: E731
        run_trial(Simulation(CROWD, 4), [recorder, keep])
    return read_recording(path), steps


def test_sightings_are_those_of_the_cameras(tmp_path) -> None:
    read, steps = robots(tmp_path / "t.rrd")
    poses, scene = (
        np.array([step.poses for step in steps]),
        make_scene(CROWD.robots, CROWD.group_kinds, CROWD.arena.build()),
    )
    expected = []
    for group in range(2):
        found = find_sightings(scene, poses, group)
        expected += [
            (row, looks, seen, int(row > 0 and steps[row - 1].ring_on[seen])) for row, looks, seen in found.tolist()
        ]
    assert sorted(map(tuple, read.sightings.tolist())) == sorted(expected)
    assert set(read.sightings[:, 3]) == {0, 1}
    assert len(expected) > 1000


def test_contacts_are_those_of_discs_that_touch(tmp_path) -> None:
    read, steps = robots(tmp_path / "t.rrd")
    reach = epuck.RADIUS_CM + GAP_CM
    expected = []
    for row, step in enumerate(steps):
        for robot, (x, y, _) in enumerate(step.poses):
            apart = np.hypot(*(step.poses[robot + 1 :, :2] - (x, y)).T)
            near = np.flatnonzero(apart <= reach + epuck.RADIUS_CM)
            expected += [(row, robot, robot + 1 + other) for other in near.tolist()]
            gaps = [x, CROWD.arena.width_cm - x, y, CROWD.arena.height_cm - y, np.hypot(x - 35, y - 30) - 5]
            expected += [(row, robot, -1) for gap in gaps if gap <= reach]
    assert sorted(map(tuple, read.contacts.tolist())) == sorted(expected)
    assert read.links is not None
    assert read.links.contact_points.shape == (len(expected), 2)
    assert {-1} < set(read.contacts[:, 2])


def test_links_of_other_robots_are_those_that_the_simulation_found(tmp_path) -> None:
    robot = {"kind": "kilobot", "camera": {"forward_cm": 0.5}}
    groups = [{"count": 20, "parameters": {"period_s": 1.0}}]
    arena = {"width_cm": 25, "height_cm": 25}
    scenario = load_scenario({"robot": robot, "robots": groups, "arena": arena, "stop": {"max_time_s": 10}})
    contacts: list[tuple[int, ...]] = []
    lit: list[tuple[int, ...]] = []

    def keep(step: Step, _: object) -> None:
        contacts.extend((step.number, *pair) for pair in step.contacts.tolist())
        lit.extend((step.number, *pair) for pair in step.sightings.tolist())

    with record(tmp_path / "t.rrd", scenario, 4, Level.FULL) as recorder:
        run_trial(Simulation(scenario, 4), [recorder, keep])
    read = read_recording(tmp_path / "t.rrd")
    assert sorted(map(tuple, read.contacts.tolist())) == sorted(contacts)
    assert sorted(tuple(row[:3]) for row in read.sightings.tolist() if row[3]) == sorted(lit)
    assert len(contacts) > 20
    assert len(lit) > 100


@pytest.mark.parametrize("settings", [[], ["space.boundary=cyclic"], ["space.dimensions=1"], ["agents.count=60"]])
def test_pulses_are_those_that_were_received(tmp_path, monkeypatch, settings: list[str]) -> None:
    scenario = load_scenario("particles", ["stop.max_cycles=12", "neighbourhood.k=3", *settings])
    found: list[list[list[int]]] = []

    class Listening(LinkSearch):
        def pulse_links(self, *given):
            found.append(super().pulse_links(*given).tolist())
            return np.array(found[-1], np.int64).reshape(-1, 3)

    monkeypatch.setattr("epuck_sim.particles.simulation.LinkSearch", Listening)
    with record(tmp_path / "t.rrd", scenario, 1) as recorder:
        run_trial(ParticleSimulation(scenario, 1), [recorder])
    read = read_recording(tmp_path / "t.rrd")
    assert read.pulses[:, 1:].tolist() == [link for links in found for link in links]
    assert (np.diff(read.pulses[:, 0]) >= 0).all()
    firing = set(zip(read.time_s[read.pulses[:, 0]].tolist(), read.pulses[:, 1].tolist(), strict=True))
    assert firing <= set(zip(read.flash_s.tolist(), read.flash_robot.tolist(), strict=True))
    assert len(read.pulses) > 100


def test_a_recording_shows_no_links_to_agents_drawn_at_random(tmp_path) -> None:
    scenario = load_scenario("particles", ["stop.max_cycles=3", "neighbourhood={kind: random}"])
    with record(tmp_path / "t.rrd", scenario, 1) as recorder:
        run_trial(ParticleSimulation(scenario, 1), [recorder])
    read = read_recording(tmp_path / "t.rrd")
    assert len(read.flash_s) > 20
    assert len(read.pulses) == 0


@pytest.mark.parametrize("level", [Level.SUMMARY, Level.POSES])
def test_a_level_that_holds_no_links_says_so(tmp_path, level: Level) -> None:
    read, _ = robots(tmp_path / "t.rrd", level)
    assert read.links is None
    for name in ("sightings", "contacts"):
        with pytest.raises(RecordingError, match=f"crowd: .*level {level} holds no {name}; .*--record-level full"):
            getattr(read, name)


def test_a_model_that_has_no_such_links_says_so(tmp_path) -> None:
    read, _ = robots(tmp_path / "t.rrd")
    with pytest.raises(RecordingError, match="embodied has no pulses; they are of model: particles"):
        _ = read.pulses


def test_the_nearest_place_may_lie_across_the_edge() -> None:
    places = np.array([[[1.0, 5.0], [6.0, 5.0]]])
    point, row = np.array([[9.5, 5.0]]), np.array([0])
    assert nearest(point, places, row, 10.0).tolist() == [0]
    assert nearest(point, places, row, np.inf).tolist() == [1]
