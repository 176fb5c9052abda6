"""The commands about scenarios and other files that users write: `check`, `list`, `page`, `play`, `predict`, `new`."""

import json
import keyword
import re
import sys
import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli import options
from epuck_sim.cli.errors import note_if_slow, prefix_scenario, reject_first
from epuck_sim.cli.options import argument, option
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.builtin import TEMPLATES, builtin_folder
from epuck_sim.util.messages import did_you_mean

scenarios = typer.Typer()


@scenarios.command()
def check(
    scenario: options.ScenarioArgument,
    settings: options.SetOption = None,
    axes: options.AxesOption = None,
    controller: options.ControllerOption = None,
    quick: options.QuickOption = False,
) -> None:
    """Validate SCENARIO, with every point of its sweep, and print it with every default written out.

    A comment at the end says how many points and trials it has, and how much disk and memory they need.
    """
    from epuck_sim.runs.sources import is_trusted, run_folder_of
    from epuck_sim.scenario.loader import RUN_SCENARIO, points, write_scenario
    from epuck_sim.sweep.demand import check_sweep, describe_size

    if (folder := run_folder_of(scenario)) is not None and not is_trusted(folder):
        changed = any((settings, axes, controller, quick))
        reject_first((changed, f"{folder}: brings code that you have not run; only what is stored can be shown"))
        sys.stdout.write((folder / RUN_SCENARIO).read_text(encoding="utf-8", errors="replace"))
        sys.stdout.write("# as stored; not checked, because that would run code that you have not run\n")
        return
    loaded = options.read_scenario(scenario, settings, axes, controller=controller, quick=quick)
    with note_if_slow(f"checking {scenario}"), prefix_scenario(scenario):
        found = points(loaded)
        check_sweep(found)
    sys.stdout.write(f"{write_scenario(loaded)}# {describe_size(found)}\n")


@scenarios.command("list")
def list_shipped(
    key: Annotated[str | None, argument("KEY", "Say instead what this key of scenarios, or this name, is.")] = None,
    measures: Annotated[bool, option("--measures", "List measures of trials, and their parameters.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """List scenarios, sweeps and controllers, or measures: those of epuck-sim, and those of installed packages."""
    from epuck_sim.cli.listing import list_keys, list_measures, list_names, print_descriptions

    reject_first((key is not None and measures, "--measures and KEY exclude each other"))
    listed = list_keys(key) if key is not None else list_measures() if measures else list_names()
    if as_json:
        print(json.dumps(listed, ensure_ascii=False, indent=2))
    else:
        print_descriptions(listed)


@scenarios.command()
def page(
    scenario: options.ScenarioArgument,
    to: Annotated[Path, option("PAGE.html", "The page, which is complete in itself.")],
    settings: options.SetOption = None,
    controller: options.ControllerOption = None,
) -> None:
    """Write one HTML file that simulates SCENARIO, with the program's own kernels, without server or network."""
    _make_page(scenario, to, settings, controller)
    typer.echo(to)


@scenarios.command()
def play(
    scenario: options.ScenarioArgument = "thesis",
    settings: options.SetOption = None,
    controller: options.ControllerOption = None,
) -> None:
    """Open SCENARIO as a page in the browser, from a file in the user's cache that the next `play` replaces."""
    from epuck_sim.util.cache_folder import cache_root

    path = cache_root().resolve() / "page.html"
    _make_page(scenario, path, settings, controller)
    webbrowser.open(path.as_uri())
    typer.echo(path)


def _make_page(scenario: str, path: Path, settings: list[str] | None, controller: str | None) -> None:
    from epuck_sim.page.writer import write_page

    with note_if_slow(f"making the page of {scenario}"), prefix_scenario(scenario):
        write_page(scenario, path, settings or (), controller=controller)


@scenarios.command()
def predict(
    scenario: options.ScenarioArgument,
    settings: options.SetOption = None,
    axes: options.AxesOption = None,
    quick: options.QuickOption = False,
    as_json: options.JsonOption = False,
    as_csv: options.CsvOption = False,
) -> None:
    """Predict regimes and T_sync of SCENARIO from who hears whom, without a trial; for a sweep, a row a point."""
    loaded = options.read_scenario(scenario, settings, axes, quick=quick)
    from epuck_sim.cli.tables import show
    from epuck_sim.theory.predict import predict_points, sweep_table

    with note_if_slow(f"predicting {scenario}"), prefix_scenario(scenario):
        found = predict_points(loaded)
    if loaded.sweep is None:
        table, record = found[0][1].table(), found[0][1]._asdict()
    else:
        records = [{"axes": point.axes, **prediction._asdict()} for point, prediction in found]
        table, record = sweep_table(loaded.name, found), {"scenario": loaded.name, "points": records}
    show([table], record, as_json=as_json, as_csv=as_csv)


IN_PYTHON = 'in Python: from epuck_sim.environments import vector_env; vector_env("thesis", 8, reward="FILE")'
NEW = {
    "scenario": (".yaml", "epuck-sim run FILE", "pillar-80"),
    "controller": (".py", "epuck-sim run thesis --controller FILE", "wanderer"),
    "measure": (".py", "epuck-sim run thesis --measure FILE", "coverage"),
    "sensor": (".py", 'epuck-sim run thesis --set "robots.0.sensors=[FILE]" --trace NAME.parquet', "ground"),
    "robot": (".yaml", "epuck-sim run thesis --set robot=FILE", "cart"),
    "curve": (".py", "epuck-sim run particles --set response.curve=FILE", "bent"),
    "reward": (".py", IN_PYTHON, "together"),
    "claims": (".yaml", "epuck-sim replicate --claims FILE --out NAME", "couplings"),
}
"""Kinds of files that `new` writes: their ending, how to try one, with NAME and FILE, and a name for one."""


@scenarios.command("new", no_args_is_help=True)
def write_new(
    kind: Annotated[str, argument("KIND", f"One of {', '.join(NEW)}.", autocompletion=lambda: [*NEW])],
    name: Annotated[str, argument("NAME", "Its name, and that of its file.")],
) -> None:
    """Write a commented file to start from, which runs as it stands."""
    reject_first((kind not in NEW, f"{did_you_mean(kind, NEW)}; allowed: {', '.join(NEW)}"))
    (ending, trial, example), one = NEW[kind], kind if kind == "claims" else f"a {kind}"
    if kind == "scenario":
        is_name, letters = re.fullmatch(r"[A-Za-z_][\w-]{0,99}", name) is not None, "letters, digits, _ and -"
    else:  # a file that Python imports, or that stands beside one
        is_name = name.isidentifier() and not keyword.iskeyword(name) and not name.startswith("_")
        letters = "letters, digits and _"
    file = f"{name}{ending}"
    from epuck_sim.control.interface import Sensors

    may_clash = is_name and ending == ".py"
    found = find_spec(name) if may_clash else None  # a folder has no origin
    is_module = may_clash and (name in sys.stdlib_module_names or getattr(found, "origin", None) is not None)
    reject_first(
        (not is_name, f"{name!r} is no name for {one}; allowed: {letters}, such as {example}"),
        (kind == "sensor" and name in Sensors._fields, f"{name!r} is a reading of all robots; give another name"),
        (Path(file).exists(), f"{file}: exists already; give another name"),
        (is_module, f"{name} is the name of a module that Python has already; give another name"),
    )
    template = (builtin_folder(TEMPLATES) / f"{kind}{ending}").read_text(encoding="utf-8")
    with atomic_write(Path(file)) as part:
        part.write_text(template.replace("NAME", name), encoding="utf-8")
    typer.echo(f"{file}: try it: {trial.replace('NAME', name).replace('FILE', file)}")
