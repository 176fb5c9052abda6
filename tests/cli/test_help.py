"""What the command tells of itself: help, completion, lists, and what it lacks in a small install."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

from typer.testing import CliRunner

from epuck_sim.cli.app import app
from epuck_sim.cli.listing import list_measures
from epuck_sim.errors import EXTRAS
from epuck_sim.scenario.changes import NOT_OF_AGENTS
from tests.cli.commands import called, read


def test_help_is_short_and_fits_a_screen_and_help_all_shows_every_option_in_groups_as_that_of_track_does() -> None:
    for words in ((), ("run",), ("new", "controller")):
        assert called(*words, "-h") == called(*words, "--help")
    for command in ("run", "summarize", "plot"):
        told = called(command, "--help", env={"COLUMNS": "80", "TERMINAL_WIDTH": "80"})
        assert len(told.splitlines()) <= 40, command
        assert max(map(len, told.splitlines())) <= 80, command
        assert "…" not in told
    assert "A YAML file, a scenario's name" in called("run", "--help")
    short, told = called("run", "--help"), called("run", "--help-all")
    places = [told.index(f" {heading} ─") for heading in ("Scenario", "Output", "More output", "Sweeps")]
    assert places == sorted(places)
    assert told.index("--seed") < places[1] < told.index("--record") < places[2] < told.index("--trace") < places[3]
    assert "--trace" not in short
    assert called("run", "--help") == short
    told = called("track", "--help")
    places = [told.index(f" {heading} ─") for heading in ("Film", "Geometry", "Decision", "Output")]
    assert places == sorted(places)
    for option, place in (("--camera", 0), ("--end-s", 0), ("--lens", 1), ("--threshold-ms", 2), ("--json", 3)):
        assert places[place] < told.index(option) < [*places, len(told)][place + 1]


def test_lists_are_also_json_and_a_key_is_explained_by_its_ending_or_section() -> None:
    listed = read("list")
    assert list(listed) == ["scenarios", "sweeps", "controllers", "robots"]
    sweeps = list(listed["sweeps"])
    assert sweeps.index("fig-5-9") < sweeps.index("fig-5-10")
    assert listed["scenarios"]["pair"].startswith("two e-pucks")
    assert listed["controllers"]["reorientation"].endswith(" {speed_cm_s: 12.8, reorientation_distance_mm: 30}")
    assert read("list", "--measures") == list_measures()
    (count,) = read("list", "robots.0.count")["model: embodied"].items()
    assert count[0] == "robots.N.count"
    assert count[1].startswith("Number of robots in the group, ")
    assert count[1].endswith(" (whole number from 0 to 100,000; default: 10)")
    for model, default in (("embodied", 10_000), ("particles", 10_000_000)):
        explained = read("list", "stop")[f"model: {model}"]
        assert explained["stop.max_cycles"].endswith(f"(whole number from 1 to 1,000,000,000; default: {default})")
        assert explained["stop.metric"].endswith('; `reference`: eq. 3.4. (complex or reference; default: "complex")')
        assert explained["stop.order_parameter"].partition("(number above 0 to 1 or null; default: 0.9")[1]
    assert called("list", "agents.speed_cm_s").splitlines()[0] == "model: particles"
    assert list(read("list", "consensus")) == ["sweeps", "measures"]


def test_parameters_of_controllers_are_explained_by_their_comments_and_kinds_that_a_model_takes_are_listed() -> None:
    key = "robots.N.parameters.speed_cm_s"
    explained = read("list", "speed_cm_s")
    fast, slow, none = explained["model: embodied"][key].split(" default: ")
    assert fast.startswith("V, straight ahead (external_ring, firefly, obstacle_avoidance, ")
    assert (slow, none) == ("12.8) the speed while the ring is lit (pushing;", "2.0)")
    assert list(explained["model: particles"]) == ["agents.speed_cm_s"]
    of_robots = {"model: embodied": {key: explained["model: embodied"][key]}}
    assert read("list", "robots.0.parameters.speed_cm_s") == of_robots
    constant = read("list", "parameters.ring_on")["model: embodied"]
    assert constant == {"robots.N.parameters.ring_on": "(constant; default: false)"}
    of_robots, of_agents = (read("list", "faults")[f"model: {model}"] for model in ("embodied", "particles"))
    fewer = [*("robots", "jitter", "sensor"), *(f"kind: {kind}" for kind in NOT_OF_AGENTS)]
    assert of_robots.keys() - of_agents.keys() == {f"faults.N.{key}" for key in fewer}
    assert of_agents.keys() - of_robots.keys() == {"faults.N.agents"}
    assert of_robots["faults.N.kind: ring_stuck_on"] == "it stays lit"
    assert of_robots["faults.N.kind: sensor_dead"] == "A sensor in a file of its own reads 0"
    (walks,) = read("list", "agents.walk.kind").values()
    assert walks["agents.walk.kind: straight"] == "no turns (the default)"
    keys = (re.match(r"  faults[.\w]+(: \w+)? +|\w", line) for line in called("list", "faults").splitlines())
    assert {key.end() for key in keys} == {1, 35}  # headings, and descriptions in one column


def test_shells_complete_names_and_options() -> None:
    for typed, completed in {
        "epuck-sim run the": ["thesis"],
        "epuck-sim run --work": ["--workers"],
        "epuck-sim check fig-4-3": ["fig-4-3a", "fig-4-3b"],
        "epuck-sim run thesis --controller reo": ["reorientation", "reorienting_firefly"],
        "epuck-sim run thesis --measure spann": ["spanning_time"],
        "epuck-sim summ": ["summarize"],
    }.items():
        words = {"COMP_WORDS": typed, "COMP_CWORD": str(len(typed.split()) - 1)}
        environment = {"_EPUCK_SIM_COMPLETE": "complete_bash", **words}
        assert CliRunner().invoke(app, [], prog_name="epuck-sim", env=environment).stdout.split() == completed


LOADED = """
import sys
from epuck_sim.cli.app import app
for words, heavy in {table}:
    try:
        app(words.split())
    except SystemExit as end:
        assert not end.code
    print("loaded", sorted(set(heavy) & sys.modules.keys()))
"""


def test_nothing_heavy_is_loaded_that_is_not_needed() -> None:
    """No scipy, where trials begin: it takes a while, and does not end well when it is interrupted."""
    drawing = ["matplotlib", "pandas", "rerun", "rerun_sdk"]
    light = [*drawing, "av", "cv2", "scipy", "numba", "numpy", "pyarrow", "pymunk", "yaml"]
    helps = ("", "run", "replay", "film", "track", "export", "summarize", "plot", "fit", "new")
    table = [*((f"{command} --help", light) for command in helps), ("list", drawing)]
    checked = ("spotlight", "crowded", "physical", "fig-4-2a", "particles", "thesis --controller constant")
    table += [(f"check {each}", [*drawing, "cv2", "scipy", "numba", "pymunk"]) for each in checked]
    begun = "import epuck_sim.cli.trials, epuck_sim.sweep.run\n" + LOADED.format(table=[("list", ["scipy"])])
    script = LOADED.format(table=table) + begun + LOADED.format(table=[("run pair --json", [*drawing, "scipy.linalg"])])
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loads = [line for line in result.stdout.splitlines() if line.startswith("loaded")]
    assert loads == ["loaded []"] * (len(table) + 2)


ROOT = Path(__file__).parent.parent.parent

WITHOUT = """
import json, sys
sys.modules.update(dict.fromkeys(sys.argv[1:]))
from epuck_sim.sweep import scheduler
from tests.cli.commands import call
from tests.sweep.pool_here import pool_here
scheduler.local_pool = pool_here
print(json.dumps([(done.exit_code, done.stderr) for done in (call(*words.split()) for words in json.load(sys.stdin))]))
"""  # calls commands in a process that cannot import some packages

LACKING = {  # which package each command lacks, and the extra that installs it
    "plot runs": ("matplotlib", "plot"),
    "report runs --to page.html": ("matplotlib", "plot"),
    "export runs --to trials.csv": ("pyarrow", "table"),
    "run pair --trace trace.parquet": ("pyarrow", "table"),
    "run pair --record pair.rrd": ("rerun-sdk", "view"),
    "run pair --film pair.mp4": ("opencv-python-headless", "film"),
    "run pair --set arena.floor.picture=runs/scenario.yaml": ("opencv-python-headless", "film"),
    "run pair --live": ("rerun-sdk", "view"),
    "run pair --out d --dask tcp://here:1": ("distributed", "cluster"),
    "track film.mp4": ("opencv-python-headless", "film"),
}


def call_without(packages: list[str], commands: list[str], folder: Path) -> list[list]:
    """Return exit code and stderr of each command, called in a process that cannot import these packages."""
    given = {"cwd": folder, "env": os.environ | {"PYTHONPATH": str(ROOT)}, "input": json.dumps(commands)}
    process = [sys.executable, "-c", WITHOUT, *packages]
    return json.loads(subprocess.run(process, **given, stdout=subprocess.PIPE, text=True, check=True).stdout)


def test_films_and_environments_need_no_extra_but_their_own(tmp_path) -> None:
    others = [module for module, (_, extra) in EXTRAS.items() if extra != "film"]
    ended = call_without(others, ["run pair --seed 3 --film pair.mp4", "track pair.mp4"], tmp_path)
    assert [code for code, _ in ended] == [0, 0], ended
    others = [module for module, (_, extra) in EXTRAS.items() if extra != "learning"]
    render = "epuck_sim.environments.parallel_env('pair', render_mode='rgb_array').render()"
    lacking = f"import sys; sys.modules.update(dict.fromkeys({others})); import epuck_sim.environments"
    for code in ("epuck_sim.film_trial", "epuck_sim.figures.plot", "epuck_sim.show", render):
        lacking += f"\ntry: {code}\nexcept epuck_sim.EpuckSimError as error: print(str(error).split('epuck-sim')[1])"
    said = subprocess.run([sys.executable, "-c", lacking], check=True, capture_output=True, text=True).stdout
    assert said.split() == ['[film]"', '[plot]"', '[view]"', '[film]"']


def test_sweeps_and_statistics_need_none_of_them_and_other_commands_say_what_they_lack(tmp_path) -> None:
    options = "--trials 5 --set stop.max_cycles=5 --out runs --measure component_count"
    sweep = f"run pair --sweep robots.0.parameters.speed_cm_s=4,8 {options}"
    whole = [sweep, *(f"{command} runs" for command in ("summarize", "status", "fit", "plan", "verify"))]
    whole += ["merge runs --out merged", "predict particles", "page pair --to pair.html"]
    ended = call_without(list(EXTRAS), [*whole, *LACKING], tmp_path)
    assert [code for code, _ in ended[: len(whole)]] == [0] * len(whole), ended
    said = 'this needs {}, which is not installed: pip install "epuck-sim[{}]"\n'
    lines = [(code, line[line.index("this") :]) for code, line in ended[len(whole) :]]
    assert lines == [(2, said.format(*each)) for each in LACKING.values()]


def test_variables_of_libraries_that_leave_nothing_to_do_are_refused_in_words(tmp_path) -> None:
    for variable, command, said in (
        ({"MPLBACKEND": "none-such"}, "plot gone", "MPLBACKEND: Key backend: 'none-such' is not a valid value"),
        ({"RERUN": "off"}, "run pair --record pair.rrd", "RERUN is off in the environment"),
    ):
        given = {"env": os.environ | variable, "capture_output": True, "text": True, "cwd": tmp_path}
        done = subprocess.run([sys.executable, "-m", "epuck_sim", *command.split()], check=False, **given)
        assert (done.returncode, "Traceback" in done.stderr) == (2, False), done.stderr
        assert done.stderr.startswith(f"error: {said}")
        assert not list(tmp_path.iterdir())


def test_letters_that_stdout_does_not_have_are_shown_as_escapes() -> None:
    words = ["run", "pair", "--set", "name=\u86cd", "--set", "stop.max_cycles=1"]
    given = {"env": os.environ | {"PYTHONIOENCODING": "ascii"}, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, "-m", "epuck_sim", *words], check=True, **given)
    assert done.stdout.startswith("\\u86cd")


def test_every_extra_installs_what_it_is_named_for_and_the_docs_name_it() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for package, extra in EXTRAS.values():
        assert package not in {re.split("[<>=]", each)[0] for each in project["dependencies"]}
        assert package in [re.split("[<>=]", each)[0] for each in extras[extra]]
    (everything,) = extras["all"]
    assert everything == f"epuck-sim[{','.join(sorted(set(extras) - {'all', 'docs', 'page', 'test', 'train'}))}]"
    page = (ROOT / "docs/small_install.md").read_text()
    assert set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == set(extras) - {"docs", "test"}
