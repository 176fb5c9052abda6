"""Claims about sensors in files of their own: what they see, who reads them, what they draw, and what is refused."""

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from epuck_sim import Simulation, load_scenario, points, read_recording, record, run_trial
from epuck_sim.arena import brightness_at, clearance_cm, light_at
from epuck_sim.control import compilation
from epuck_sim.control.loader import find_controller, find_sensor
from epuck_sim.environments import parallel_env
from epuck_sim.testing import TestRobot
from epuck_sim.trial.trace import Trace
from tests.control.bench import with_sense, with_step
from tests.embodied.scenes import cast_on_discs, cast_on_segments, walls_of

UNIFORM = "from epuck_sim.util.rng import uniform\n"
GROUND = f"import math\n{UNIFORM}" + with_sense(
    """x = robot.x + parameters.ahead_cm * math.cos(robot.heading)
    readings.ground[0] = x / world.width_cm + parameters.noise * uniform(random)
    readings.ground[1] = world.time_s
    readings.own_number = robot.number""",
    "{'own_number': int, 'ground': (float, 2)}",
    "{'noise': 0.0, 'ahead_cm': 3.0}",
)
RANDOM = UNIFORM + with_sense("readings.%s = uniform(random)", "{'%s': float}")
FOLLOWER = with_step(
    """memory.seen = sensors.ground[0] + sensors.own_number
    actuators.left_cm_s = parameters.speed_cm_s * sensors.ground[0]
    actuators.right_cm_s = parameters.speed_cm_s""",
    PARAMETERS="{'speed_cm_s': 5.0}",
    MEMORY="{'seen': float}",
)
WANDERER = FOLLOWER.replace("sensors.ground[0] + sensors.own_number", "0.5").replace("sensors.ground[0]", "0.7")


@pytest.fixture(autouse=True)
def files(here):
    """Return a function that writes files into the working directory, an empty one; some are there from the start."""

    def write(**contents):
        for name, text in contents.items():
            (here / f"{name}.py").write_text(text)

    write(ground=GROUND, follower=FOLLOWER, wanderer=WANDERER, dice=RANDOM % ("dice", "dice"))
    return write


def scenario(sensors=("ground.py",), controller="follower.py", count=4, **keys):
    return {"robots": [{"count": count, "controller": controller, "sensors": list(sensors)}], **keys}


def test_compiled_and_interpreted_sensors_read_what_the_file_computes_and_so_do_their_controllers():
    found = []
    for interpret in (False, True):
        simulation = Simulation(scenario([{"ground.py": {"noise": 0.3, "ahead_cm": 2.0}}]), 3, interpret=interpret)
        for number in range(20):
            step = simulation.advance(1)
            ground = step.readings["ground"]
            noise = 60 * ground[:, 0] - (step.poses[:, 0] + 2.0 * np.cos(step.poses[:, 2]))
            assert ((noise > -1e-9) & (noise < 0.3 * 60)).all()
            np.testing.assert_allclose(ground[:, 1], number / 10)
            assert step.readings["own_number"].tolist() == [0, 1, 2, 3]
            np.testing.assert_array_equal(step.memories[0]["seen"], ground[:, 0] + step.readings["own_number"])
        found.append([b"".join(values.tobytes() for values in (step.poses, *step.readings.values()))])
    assert found[0] == found[1]


@pytest.mark.parametrize("interpret", [False, True])
def test_a_sensor_hears_what_another_robot_sent_in_the_step_before(files, interpret):
    hear = "readings.said = world.robots[1 - robot.number].actuators.send"
    files(ear=with_sense(hear, "{'said': int}"), teller=with_step("actuators.send = 7 + sensors.said"))
    simulation = Simulation(scenario(["ear.py"], "teller.py", 2), interpret=interpret)
    assert [simulation.advance(1).readings["said"].tolist() for _ in range(3)] == [[0, 0], [7, 7], [14, 14]]
    assert not any("sends" in note for note in simulation.scenario.notes)


def test_a_sensor_that_nobody_reads_changes_no_outcome():
    given = load_scenario("thesis").model_dump(mode="json")
    given["robots"][0]["sensors"] = [{"ground.py": {"noise": 0.3}}]
    poses = [Simulation(each, 5).advance(60).poses.tobytes() for each in ("thesis", given)]
    assert poses[0] == poses[1]


def test_sensors_draw_from_streams_that_depend_on_their_files_and_the_robot_alone(files, tmp_path):
    files(other=RANDOM % ("other", "other"))
    alone = Simulation(scenario(["dice.py"], "wanderer.py"), 2, interpret=True)
    beside = Simulation(scenario(["other.py", "dice.py"], "wanderer.py", count=7), 2, interpret=True)
    for _ in range(5):
        drawn, others = alone.advance(1).readings["dice"], beside.advance(1).readings
        np.testing.assert_array_equal(others["dice"][:4], drawn)
        assert len({*others["dice"], *others["other"]}) == 14
    (tmp_path / "left").mkdir()
    (tmp_path / "left" / "dice.py").write_text(RANDOM % ("left", "left"))  # a file of the same name
    robots = [{"count": 3, "controller": "wanderer.py", "sensors": {"a": "dice.py", "b": "left/dice.py"}}]
    readings = Simulation({"robots": robots}, 1, interpret=True).advance(1).readings
    assert not (readings["left"] == readings["dice"]).any()


def test_groups_have_sensors_of_their_own_and_common_ones():
    groups = [{"count": 2, "controller": "follower.py"}, {"count": 1, "controller": "wanderer.py", "sensors": []}]
    readings = Simulation({"robots": groups, "sensors": ["ground.py"]}, 1, interpret=True).advance(1).readings
    np.testing.assert_array_equal(np.isnan(readings["ground"]).all(axis=1), [False, False, True])


def test_a_file_of_several_groups_is_compiled_once_and_an_edited_one_anew(files, monkeypatch):
    assert Simulation(scenario(controller="external"), 1).advance(1).readings["own_number"][3] == 3
    files(ground=GROUND.replace("= robot.number", "= robot.number * 10"))
    assert Simulation(scenario(controller="external"), 1).advance(1).readings["own_number"][3] == 30
    files(ground=GROUND.replace("3.0", "3.125"), sees=FOLLOWER.replace("5.0", "5.125"))
    compiled = []
    monkeypatch.setattr(compilation, "compile_cached", lambda *given, make=compilation.compile_cached, **options: (
        compiled.append(given[0].__name__), make(*given, **options))[1])  # fmt: skip
    group = {"count": 2, "controller": "sees.py", "sensors": ["ground.py"]}
    given = {"robots": [group, group, {**group, "sensors": [{"ground.py": {"noise": 0.1}}]}]}
    Simulation(given, 1).advance(3)
    assert sorted(compiled) == ["run_group", "run_sensor"]


def test_faults_and_schedules_act_on_a_sensor_by_its_name(files):
    """A dead one reads 0 and counts on; robots that are not in the arena read nothing."""
    files(counter=with_sense("readings.steps += 1; readings.metres[1] += 0.5", "{'steps': int, 'metres': (float, 2)}"))
    dead = {"kind": "sensor_dead", "sensor": "counter", "robots": [1], "at_s": 1, "until_s": 2}
    later = {"at_s": 2, "add": [2], "set": {"robots.0.sensors.ground.ahead_cm": 0.0}}
    given = scenario(["ground.py", "counter.py"], faults=[dead], schedule=[{"at_s": 1, "remove": [2]}, later])
    given["robots"].append({"count": 1})
    simulation = Simulation(given, 1, interpret=True)
    for steps, alive in ((10, [1, 1, 1, 1]), (5, [1, 0, 0, 1]), (6, [1, 1, 0, 1])):
        step = simulation.advance(steps)
        counted = simulation.steps * np.array([*alive, np.nan])
        others = [0, 1, 3]
        np.testing.assert_array_equal(step.readings["steps"][others], counted[others])
        np.testing.assert_array_equal(step.readings["metres"][others, 1], counted[others] / 2)
        assert np.isnan(step.readings["steps"][4])
        assert (step.readings["ground"][2, 0] > 0) == (steps != 5)
    np.testing.assert_allclose(step.readings["ground"][:4, 0], step.poses[:4, 0] / 60)
    half = {"kind": "sensor_dead", "sensor": "counter", "share": 0.5}
    simulation = Simulation({**given, "faults": [half], "schedule": []}, 1, interpret=True)
    simulation.advance(1)
    assert [(len(event.robots), 4 in event.robots) for event in simulation.events] == [(2, False)]  # of those with it


def test_readings_are_in_traces_recordings_notebooks_and_observations_without_another_line(tmp_path):
    loaded = load_scenario(scenario(controller="external", stop={"max_time_s": 2}))
    simulation = Simulation(loaded, 1)
    with Trace(tmp_path / "t.parquet", loaded, 1) as trace, record(tmp_path / "r.rrd", loaded, 1) as recorder:
        run_trial(simulation, observers=[trace, recorder])
    table, recorded = pq.read_table(tmp_path / "t.parquet"), read_recording(tmp_path / "r.rrd").memory
    step, names = simulation.last_step, {"sensors.ground.0", "sensors.ground.1", "sensors.own_number"}
    assert names == set(recorded)
    assert names <= set(table.column_names)
    for last in (table.column("sensors.ground.0").to_numpy()[-4:], recorded["sensors.ground.0"][-1]):
        np.testing.assert_array_equal(last, step.readings["ground"][:, 0])
    assert '>ground</th><th scope="col">own_number</th>' in step._repr_html_()
    observed, _ = parallel_env(loaded).reset(seed=1)
    start = Simulation(loaded, 1).advance(1).readings["ground"]
    expected = [[*row, number] for number, row in enumerate(start)]
    np.testing.assert_allclose([row[-3:] for row in observed.values()], expected, rtol=1e-6)


@pytest.mark.parametrize("code", ["sensor", "controller"])
def test_who_is_at_work_is_known_while_it_is(files, code):
    """The sweep's watchdog asks from another thread, and names what does not return."""
    look = "LOOK = [int]\n\n\ndef look():\n    LOOK[0]()\n"
    sensor, controller = ("ground", GROUND, "    x = "), ("follower", FOLLOWER, "    memory.seen = sensors")
    name, text, line = sensor if code == "sensor" else controller
    files(**{name: look + text.replace(line, f"    look()\n{line}")})
    simulation, seen = Simulation(scenario(count=2), 1, interpret=True), []
    find = {"sensor": find_sensor, "controller": find_controller}[code]
    (module,) = find(f"{name}.py").modules.values()
    module.LOOK[0] = lambda: seen.append(simulation.at_work())
    assert simulation.at_work() is None
    simulation.advance(2)
    said = "sensor ground" if code == "sensor" else "controller"
    assert seen == [(robot, step, said) for step in (0, 1) for robot in (0, 1)]
    assert simulation.at_work() is None


def test_a_robot_of_a_unit_test_reads_what_is_set():
    robot = TestRobot("follower.py", sensors=["ground.py"])
    robot.readings.ground[0], robot.readings.own_number = 0.25, 3
    robot.step()
    assert (robot.left_cm_s, robot.memory.seen) == (1.25, 3.25)
    with pytest.raises(AttributeError, match="did you mean 'ground'"):
        _ = robot.readings.grond
    robot.readings.ground[1] = np.inf
    robot.step()
    robot.readings.ground[1] = np.nan
    with pytest.raises(ValueError, match=r"readings\.ground is \[0.25  +nan\]; allowed: numbers"):
        robot.step()


@pytest.mark.parametrize("interpret", [False, True])
def test_a_reading_may_be_infinite_as_what_lies_beyond_a_range(files, interpret):
    files(ground="import math\n" + with_sense("readings.ground[1] = math.inf", "{'ground': (float, 2)}"))
    far = Simulation(scenario(controller="wanderer.py"), 1, interpret=interpret).advance(1).readings["ground"]
    assert (far == [0, np.inf]).all()


def test_sensors_given_anew_take_the_place_of_those_of_all_robots_and_so_do_another_robot_s(tmp_path):
    for name, sensor in (("one", "dice.py"), ("other", "ground.py")):
        (tmp_path / f"{name}.yaml").write_text(f"radius_cm: 4\nsensors: [{sensor}]\n")
    given = {"robots": [{"count": 2, "controller": "wanderer.py"}], "stop": {"max_time_s": 1}}
    for key, anew in (
        ({"sensors": ["ground.py"]}, {"sensors=[dice.py]": {"dice"}, "sensors=[]": set()}),
        ({"robot": "one.yaml"}, {"robot=other.yaml": {"ground"}, "robot=epuck": set()}),
    ):
        for base in (given | key, load_scenario(given | key)):
            assert [set(load_scenario(base, [each]).robots[0].sensors) for each in anew] == list(anew.values())
            for typed in ("ground.noise", "sensors.ground.noise"):
                if "ground" in load_scenario(base).robots[0].sensors:
                    assert load_scenario(base, [f"{typed}=0.5"]).robots[0].sensors["ground"]["noise"] == 0.5


def test_sensors_and_robots_of_an_axis_are_looked_for_in_the_scenario_s_folder(tmp_path, monkeypatch):
    (tmp_path / "cart.yaml").write_text("radius_cm: 4\nsensors: [ground.py]\n")
    (tmp_path / "s.yaml").write_text("robots: [{count: 2, controller: wanderer.py}]\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")

    def swept(axis):
        return points(load_scenario("../s.yaml", axes=[axis]))

    for key in ("sensors", "robots.0.sensors"):
        found = swept(f"{key}=[dice.py],[dice.py, {{ground.py: {{noise: 0.5}}}}],{{left: {{file: ground.py}}}}")
        assert [list(point.scenario.robots[0].sensors) for point in found] == [["dice"], ["dice", "ground"], ["left"]]
        assert [point.axes[key] for point in found[:2]] == [["dice.py"], ["dice.py", {"ground.py": {"noise": 0.5}}]]
    for key in ("robot", "robots.0.kind"):
        found = swept(f"{key}=cart.yaml,epuck")
        assert [list(point.scenario.robots[0].sensors) for point in found] == [["ground"], []]
        assert [point.axes[key] for point in found] == ["cart.yaml", "epuck"]


LOOKS = "import math\nfrom epuck_sim.embodied import sensing\n" + with_sense(
    """x, y, reach = robot.x, robot.y, parameters.range_cm
    readings.brightness, readings.light = sensing.brightness_at(world, x, y), sensing.light_at(world, x, y)
    readings.clearance = sensing.clearance_cm(world, x, y)
    readings.nearest = sensing.nearest_robot(world, x, y, reach, robot.number)
    readings.anywhere = sensing.nearest_robot(world, x, y, math.inf, robot.number)
    readings.alone = sensing.nearest_robot(world, x, y, reach)
    readings.distance = sensing.distance_cm(world, x, y, robot.heading, range_cm=reach, but=robot.number)""",
    "dict.fromkeys(['brightness', 'light', 'clearance', 'distance'], float)"
    " | dict.fromkeys(['nearest', 'alone', 'anywhere'], int)",
    "{'range_cm': 20.0}",
)
CIRCLE = {"shape": "circle", "x_cm": 40, "y_cm": 40, "radius_cm": 8}
BOX = {"shape": "box", "x_cm": 90, "y_cm": 90, "width_cm": 20, "height_cm": 10, "heading_rad": 0.4}
LAMPS = [{"x_cm": 20, "y_cm": 100}, {"x_cm": 120, "y_cm": 10, "height_cm": 12, "strength": 3.0}]
ARENA = {"width_cm": 150, "height_cm": 120, "obstacles": [CIRCLE, BOX], "lamps": LAMPS}
PATCHES = [
    {"shape": "circle", "x_cm": 70, "y_cm": 50, "radius_cm": 40, "brightness": 0.25},
    {"shape": "polygon", "corners_cm": [[100, 20], [130, 25], [120, 60]], "brightness": 0.5},
    {"shape": "circle", "x_cm": 110, "y_cm": 40, "radius_cm": 12, "brightness": 0.75},
]


def distance_ahead(step, number, range_cm):
    """Return the distance from a robot's centre, straight ahead, to the first body or wall."""
    x, y, heading = step.poses[number]
    ray = np.array([[x, y]]), np.array([[np.cos(heading), np.sin(heading)]])
    others = np.insert(np.delete(step.poses[:, :2], number, axis=0), 2, 3.7, axis=1)
    discs, _ = cast_on_discs(*ray, np.vstack([others, step.arena.circles]))
    flats, _ = cast_on_segments(*ray, np.vstack([walls_of(step.arena), step.arena.edges]))
    nearest = min(discs.min(), flats.min())
    return nearest if nearest <= range_cm else np.inf


@pytest.mark.parametrize("has_picture", [True, False])
def test_slow_twins_see_the_same(files, has_picture):
    files(looks=LOOKS)
    picture = np.random.default_rng(1).integers(0, 256, (13, 31), np.uint8)
    cv2.imwrite("floor.png", picture)
    floor = {"patches": PATCHES, **({"picture": "floor.png"} if has_picture else {"brightness": 0.9})}
    robots = [{"count": 30, "controller": "obstacle_avoidance", "sensors": ["looks.py"]}]
    simulation = Simulation({"arena": {**ARENA, "floor": floor}, "robots": robots}, 4)
    levels = set()
    for _ in range(3):
        step = simulation.advance(6)
        (x, y), seen = step.poses[:, :2].T, step.readings
        np.testing.assert_array_equal(seen["brightness"], brightness_at(step.arena, x, y))
        np.testing.assert_allclose(seen["light"], light_at(step.arena, x, y), rtol=1e-12)
        apart = np.hypot(x[:, None] - x, y[:, None] - y) + np.diag(np.full(30, np.inf))
        nearest = np.where(apart.min(axis=1) < 20, apart.argmin(axis=1), -1)
        np.testing.assert_array_equal(seen["nearest"], nearest)
        np.testing.assert_array_equal(seen["alone"], np.arange(30))
        np.testing.assert_array_equal(seen["anywhere"], apart.argmin(axis=1))
        np.testing.assert_allclose(seen["clearance"], [clearance_cm(step.arena, *each) for each in step.poses[:, :2]])
        np.testing.assert_allclose(seen["distance"], [distance_ahead(step, robot, 20) for robot in range(30)])
        levels |= set(seen["brightness"])
    assert {0.25, 0.5} <= levels
    assert len(levels) > 3
    away = [{"count": 1, "sensors": ["looks.py"]}, {"count": 2, "present": False}]
    assert Simulation({"robots": away}).advance(1).readings["anywhere"][0] == -1
