"""The commands about results: `export`, `summarize`, `fit`, `compare`, `plot`, `report`, `plan` and `replicate`."""

import math
import re
from contextlib import closing
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from epuck_sim.cli import options
from epuck_sim.cli.errors import note_if_slow, prefix_scenario, print_stderr, reject_first
from epuck_sim.cli.options import argument, looks_option, option
from epuck_sim.statistics import Statistic
from epuck_sim.util.messages import counted

results = typer.Typer()

_STATISTIC_HELP = (
    "Statistic of the trials at a point: by default their mean (restricted to the limit of cycles where trials are "
    "censored); their median; or the mean of the nearest Weibull distribution (Appendix A)."
)

Form = StrEnum("Form", ["CURVES", "MAP", "VIOLINS", "SERIES", "PERTURBATION", "COURSE"])  # ways to draw a sweep


@results.command("export")
def export_results(
    folder: options.FolderArgument,
    to: Annotated[Path, option("FILE", "A .parquet or .csv file; a row for each trial.")],
) -> None:
    """Write the results of a sweep as one table."""
    from epuck_sim.runs.export import export

    export(folder, to)
    _name_failed([folder])
    typer.echo(bytes(to))  # its name may be no text


def _name_failed(folders: list[Path]) -> None:
    from epuck_sim.runs.reader import count_failed

    for folder in dict.fromkeys(folders):
        if failed := count_failed(folder):
            print_stderr(f"left out: {counted(failed, 'trial')} that failed; see: epuck-sim status {folder}")


@results.command()
def summarize(
    folder: options.FolderArgument,
    of: options.OfOption = None,
    where: options.WhereOption = None,
    as_json: options.JsonOption = False,
    as_csv: options.CsvOption = False,
) -> None:
    """Print the statistics of T_sync, or of a measure, at each point of a sweep; censored trials are accounted for.

    For a measure that is a series, print them at each cycle; the table shows some of the cycles.
    """
    from epuck_sim.cli.tables import show
    from epuck_sim.runs.reader import each_point, read_points
    from epuck_sim.statistics.curves import has_series, series_table, summarize_series
    from epuck_sim.statistics.statistic import measure_unit, quantity, summarize as statistics

    points = read_points(folder, of, where) if of else None
    if points and any(map(has_series, points)):
        series = summarize_series(points)
        title = f"{folder}: {quantity(of, measure_unit(points[0]))}"
        table, found = series_table(title, series), [each.record() for each in series]
    else:
        with closing(each_point(folder, of, where)) as each:  # else an error's traceback would hold its transaction
            summaries = statistics(points or each)
        table, found = summaries.table(str(folder)), [each.record() for each in summaries]
    show([table], found, as_json=as_json, as_csv=as_csv)
    _name_failed([folder])


@results.command()
def fit(
    folders: Annotated[list[Path], argument("FOLDER", "Run folders of sweeps.")],
    statistic: Annotated[Statistic, option("mean|median|weibull-mean", _STATISTIC_HELP)] = Statistic.MEAN,
    of: options.OfOption = None,
    x: Annotated[str | None, option("--x KEY", "Axis of --of; by default the speed.")] = None,
    power: Annotated[
        str | None, option("KEY,...", "Fit a product of powers of these axes to the trials, censored ones included.")
    ] = None,
    where: options.WhereOption = None,
    as_json: options.JsonOption = False,
    as_csv: options.CsvOption = False,
) -> None:
    """Print the local minimum and the peak of T_sync against speed, and the laws by which they scale.

    For a measure, print its minimum and its peak along an axis. With --power, print by which powers of axes it grows.
    """
    from epuck_sim.cli.tables import show
    from epuck_sim.runs.reader import read_points
    from epuck_sim.statistics import fit as fitting

    reject_first(
        (bool(power and x), "--power has axes of its own; leave --x out"),
        (power is not None and statistic != Statistic.MEAN, "--power is of medians; leave --statistic out"),
        (x is not None and of is None, "--x is for measures, and seconds: --of NAME, or --of t_sync_s"),
    )
    read = [read_points(folder, of, where) for folder in folders]
    found: Any
    if power is not None:
        keys = [key.strip() for key in power.split(",")]
        found = [fit for points in read for fit in fitting.fit_powers(points, keys)]
        tables = [fitting.powers_table(found)]
    elif of is not None:
        fits = [fit for points in read for fit in fitting.fit_measure(points, x, statistic)]
        tables, found = [fitting.measure_fit_table(fits)], [fit.record() for fit in fits]
    else:
        curves = [curve for points in read for curve in fitting.fit_curves(points, statistic)]
        laws = fitting.fit_laws(curves)
        tables = fitting.fit_tables(curves, laws)
        found = {"curves": [curve.record() for curve in curves], "laws": laws}
    show(tables, found, as_json=as_json, as_csv=as_csv)
    _name_failed(folders)


@results.command()
def compare(
    folders: Annotated[list[Path], argument("FOLDER", "Run folders with the same axes; or one, for --axis.")],
    axis: Annotated[
        list[str] | None, option("KEY=A,B,...", "Compare values of an axis of one folder: robots.0.count=5,10")
    ] = None,
    points: Annotated[
        list[str] | None,
        option(
            "K,L,...", "Compare these points, one of each folder, or several of one, whatever their axes; repeatable."
        ),
    ] = None,
    with_first: Annotated[bool, option("--with-first", "Compare each with the first, instead of all pairs.")] = False,
    of: options.OfOption = None,
    where: options.WhereOption = None,
    as_json: options.JsonOption = False,
    as_csv: options.CsvOption = False,
) -> None:
    """Print how T_sync, or a measure, differs between run folders, values of an axis, or points."""
    from epuck_sim.cli.tables import show
    from epuck_sim.runs.reader import read_points
    from epuck_sim.scenario.keys import parse_axis
    from epuck_sim.statistics import comparison

    names, places = [*map(str, folders)], [folder.resolve() for folder in folders]
    twice = [name for name, place in zip(names, places, strict=True) if places.count(place) > 1]
    is_incomplete = bool(axis) if len(folders) > 1 else not (axis or points)
    complete = "give two or more run folders, or one and --axis KEY=A,B or --points K,L"
    reject_first(
        (bool(axis and points), "--axis and --points exclude each other"),
        (bool(points and where), "--points names what is compared; leave --where out"),
        (len(axis or ()) > 1, f"--axis is given {len(axis or ())} times; allowed: once"),
        (is_incomplete, complete),
        *((not points, f"{name} is given twice; allowed: other folders") for name in twice),
    )
    read = [read_points(folder, of, where) for folder in folders]
    if axis:
        samples = comparison.match_values(read[0], *parse_axis(axis[0], "--axis"))
    elif points:
        allowed = "allowed: numbers of points, one for each folder, or several of one, as in 3,0"
        wrong = ((re.fullmatch(r"\s*\d+\s*(,\s*\d+\s*)+", text) is None, text) for text in points)
        reject_first(*((is_wrong, f"--points is {text!r}; {allowed}") for is_wrong, text in wrong))
        chosen = [[*map(int, text.split(","))] for text in points]
        if len(read) == 1:
            sides = range(1, max(2, len(chosen[0])) + 1)
            read, names = len(sides) * read, [f"{folders[0]}, place {side}" for side in sides]
        samples = comparison.match_points(read, names, chosen)
    else:
        samples = comparison.match_folders(read, names)
    with note_if_slow("comparing"):
        compared = comparison.compare(samples, with_first=with_first)
    found = compared[0] if len(samples.names) == 2 else compared
    show(comparison.comparison_tables(compared), found, as_json=as_json, as_csv=as_csv)
    _name_failed(folders)


@results.command(cls=options.FoldedCommand)
def plot(
    results: Annotated[list[Path], argument("FOLDER", "Run folders of one scenario, or FILE.rrd, a recording.")],
    of: options.OfOption = None,
    where: options.WhereOption = None,
    form: Annotated[
        Form | None, option("FORM", f"One of {', '.join(Form)}; by default as the scenario says, or curves.")
    ] = None,
    x: Annotated[str | None, option("KEY", "Horizontal axis; by default the speed.")] = None,
    y: Annotated[str | None, option("KEY", "Vertical axis of a map.")] = None,
    panels: Annotated[str | None, option("KEY", "For curves: an axis that gets a panel for each value.")] = None,
    names: Annotated[str | None, option("NAME,...", "Names of several folders; by default, their own.")] = None,
    to: Annotated[
        Path | None,
        option(
            "FILE",
            "Write one picture, FILE.png, FILE.svg or FILE.pdf, or STEM.png, STEM.svg and so on; by default STEM is "
            "FOLDER/T_sync or FOLDER/NAME_OF_MEASURE, with -FORM if --form is given, or the recording's name.",
        ),
    ] = None,
    statistic: Annotated[Statistic | None, looks_option("mean|median|weibull-mean", _STATISTIC_HELP)] = None,
    censored_at: Annotated[
        int | None, looks_option("CYCLES", "For violins: the mean as if trials were censored after CYCLES.", min=1)
    ] = None,
    log: Annotated[
        bool | None, looks_option("--log/--linear", "Scale of T_sync or the measure.", show_default="log for T_sync")
    ] = None,
    points: Annotated[bool, looks_option("--points", "Draw each trial as a dot, in curves and violins.")] = False,
    theory: Annotated[
        bool, looks_option("--theory", "Add T_sync against speed as `predict` gives it, dashed, under the curves.")
    ] = False,
    title: Annotated[str | None, looks_option("TEXT", "Title; a sweep's figure has none by default.")] = None,
    label: Annotated[
        list[str] | None, looks_option("KEY=TEXT", "Label of an axis, or of T_sync or a measure; may be repeated.")
    ] = None,
    width_cm: Annotated[
        float | None,
        looks_option(
            "CM",
            "Width of a sweep's figure; by default 8.5 (a column), or 17.5 (a page) for several panels.",
            min=5,
            max=100,
        ),
    ] = None,
    font_pt: Annotated[float | None, looks_option("PT", "Size of letters; 8 points by default.", min=4, max=30)] = None,
    help_all: options.HelpAllOption = False,  # noqa: ARG001
) -> None:
    """Draw T_sync or a measure of sweeps, as curves, a map or violins; their trials over time; or a recorded trial.

    A caption and the numbers are written beside the figure. A scenario's section figure has the same options.
    """
    from epuck_sim.figures.saving import Target, parse_target, save_figure
    from epuck_sim.figures.sweep_figure import read_form
    from epuck_sim.scenario.axes import SIMULATED_AGAIN

    target = parse_target(to) if to else None
    reject_first(*(("=" not in text, f"--label is {text!r}; allowed: KEY=TEXT") for text in label or ()))
    wanted = {
        "form": form,
        "x": x,
        "y": y,
        "panels": panels,
        "censored_at_cycles": censored_at,
        "statistic": statistic,
        "title": title,
        "labels": dict(text.split("=", 1) for text in label) if label else None,
        "scale": None if log is None else "log" if log else "linear",
        "points": points or None,
        "theory": theory or None,
        "width_cm": width_cm,
        "font_pt": font_pt,
    }
    if len(results) > 1 or results[0].is_dir():
        named = [name.strip() for name in names.split(",")] if names else []
        drawn = read_form(results, wanted, of, named, "--", where)
        of_form = f"-{form}" if form else ""
        stem = drawn.name if drawn.name in SIMULATED_AGAIN else f"{of or 'T_sync'}{of_form}"
        others = "".join(f"-with-{folder.resolve().name}" for folder in results[1:])
        place = target or Target(results[0] / f"{stem}{others}")
        files = save_figure(place, drawn.draw_figure, drawn.tables, drawn.caption)
        _name_failed(results)
        for note in drawn.notes:
            typer.echo(f"note: {note}", err=True)
    else:
        of_sweeps = {**wanted, "title": None, "label": label, "labels": None, "of": of, "where": where, "names": names}
        files = _draw_recording(results[0], of_sweeps, title, target)
    for file in files:
        typer.echo(file)


def _draw_recording(file: Path, of_sweeps: dict[str, Any], title: str | None, target: Any) -> list[Path]:
    from epuck_sim.figures.saving import Target, save_figure
    from epuck_sim.figures.sweep_figure import flag
    from epuck_sim.figures.trial_page import check_drawable, draw_page
    from epuck_sim.recording.reader import read_recording

    for name, value in (of_sweeps if file.is_file() else {}).items():  # if it is missing, reading it says so
        reject_first((value is not None, f"{flag(name, value)} is for run folders; {file} is a recording"))
    recorded = read_recording(file)
    check_drawable(recorded, str(file))
    return save_figure(target or Target(file.with_suffix("")), lambda: draw_page(recorded, title))


@results.command()
def report(
    folder: options.FolderArgument,
    to: Annotated[Path | None, option("PAGE.html", "The page; by default FOLDER.html, beside the folder.")] = None,
) -> None:
    """Write a page about a sweep, complete in itself: what was run, tables, figures, failed trials, commands."""
    from epuck_sim.figures.report import write_report

    page = to or folder.resolve().with_name(f"{folder.resolve().name}.html")
    write_report(folder, page)
    typer.echo(page)


@results.command()
def plan(
    sweep: Annotated[str, argument("SCENARIO|FOLDER", "A scenario to be run, or a run folder.")],
    difference: Annotated[
        float | None,
        option("PERCENT", "For a run folder: the difference to detect; 20 by default.", min=0.1, max=10_000),
    ] = None,
    of: options.OfOption = None,
    power: Annotated[
        float | None, option("PERCENT", "How often to detect it, with p < 0.05; 80 by default.", min=5.0, max=99.9)
    ] = None,
    trials: options.TrialsOption = None,
    settings: options.SetOption = None,
    axes: options.AxesOption = None,
    quick: options.QuickOption = False,
    seconds: Annotated[
        float | None, option("S", "Seconds to spend on timing trials of a scenario; 20 by default.", min=0.1, max=3600)
    ] = None,
    workers: options.WorkersOption = None,
    trust: options.TrustOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Print how long a sweep will take, by timing some of its trials, or how long the rest of one will take.

    For a run folder, also print how many trials a point needs to show --difference, given the spread of stored trials:
    a difference in per cent of T_sync or a measure; for a truth value, in percentage points of its share of trials.
    """
    from epuck_sim.cli.plan import duration_of_folder, duration_of_scenario, print_plan
    from epuck_sim.runs.folder import DATABASE
    from epuck_sim.runs.reader import read_points
    from epuck_sim.scenario.loader import points as find_points
    from epuck_sim.statistics.planning import plan_trials
    from epuck_sim.sweep.demand import check_sweep
    from epuck_sim.sweep.scheduler import available_cores

    folder = Path(sweep)
    is_folder = (folder / DATABASE).is_file()
    of_trials = ("--difference", difference), ("--of", of), ("--power", power)
    needs = "needs trials: give a run folder, as `run --trials 20 --out FOLDER` makes it"
    reject_first(
        (is_folder and bool(settings or axes or quick), "--set, --sweep and --quick are for scenarios"),
        (is_folder and seconds is not None, "--seconds is for scenarios; the trials of a run folder are timed"),
        *((not is_folder and given is not None, f"{name} {needs}") for name, given in of_trials),
    )
    processes, planned = workers or available_cores(), None
    if is_folder:
        stored = read_points(folder, of=of)
        if of or difference or all(point.has_t_sync for point in stored):
            planned = plan_trials(stored, (difference or 20) / 100, (power or 80) / 100)
        else:
            typer.echo("note: trials have no T_sync; give --of NAME to see how many trials a measure needs", err=True)
        duration = duration_of_folder(folder, trials, processes, trusted=trust)
    else:
        loaded = options.read_scenario(sweep, settings, axes, quick=quick)
        with prefix_scenario(sweep):
            found = find_points(loaded)
            check_sweep(found)
            duration = duration_of_scenario(found, trials or loaded.trials, seconds or 20, processes)
    print_plan(sweep, duration, planned, as_json=as_json)


@results.command()
def replicate(
    claims: Annotated[list[str] | None, argument("CLAIM", "Claims, such as R36; all by default.")] = None,
    out: Annotated[Path, option("FOLDER", "Folder of the page and its run folders.")] = Path("replication"),
    file: Annotated[
        str | None, option("--claims FILE.yaml", "Test the claims in this file instead of the thesis's.")
    ] = None,
    only_list: Annotated[bool, option("--list", "Print the claims, and run nothing.")] = False,
    until_decided: Annotated[
        bool, option("--until-decided", "Add trials where claims are undecided, the cheapest first.")
    ] = False,
    cpu_hours: Annotated[
        float | None, option("H", "Limit of the computing time that --until-decided adds.", min=0)
    ] = None,
    workers: options.WorkersOption = None,
    dask: options.DaskOption = None,
) -> None:
    """Test claims of the thesis: run the trials that are missing, and write a page with a verdict on each claim."""
    reject_first(
        (None not in (workers, dask), "--workers and --dask exclude each other"),
        (cpu_hours is not None and not until_decided, "--cpu-hours is a limit of --until-decided, which is not given"),
    )
    from epuck_sim.cli.tables import terminal_width
    from epuck_sim.replication.claims import read_claims

    known = read_claims(file or "thesis")
    chosen = known.choose(tuple(claims or ()))
    if only_list:
        for claim in chosen:
            typer.echo(f"{claim.id:4} {claim.section:12} {claim.claim}{'' if claim.checks else ' (no trials)'}")
        return
    from epuck_sim.cli.progress import SweepProgressBar
    from epuck_sim.replication.page import read_contents, write_replication
    from epuck_sim.replication.sweeps import LOOKS, Decider, Trials, begun, needed_sweeps, sweep_folder
    from epuck_sim.scenario.scenario import Scenario
    from epuck_sim.sweep.cluster import DaskCluster
    from epuck_sim.sweep.run import run_sweep

    pool = workers if dask is None else DaskCluster(dask).open
    needed = needed_sweeps(known, chosen)
    folders = {name: sweep_folder(out, name) for name in needed}
    failed = dict.fromkeys(needed, 0)

    def run(name: str, scenario: Scenario) -> None:
        with SweepProgressBar() as bar:
            failed[name] = run_sweep(scenario, folders[name], pool, bar).failed

    for name, scenario in needed.items():
        print_stderr(f"{name}:")
        run(name, begun(scenario, folders[name]))
    decider = Decider(chosen, needed, folders) if until_decided else None
    for line in decider.run(run, math.inf if cpu_hours is None else 3600 * cpu_hours) if decider else ():
        print_stderr(line)
    trials = Trials(folders)
    contents = read_contents(known, chosen, needed, trials, out, file, LOOKS if until_decided else 1)
    page = write_replication(contents, trials, out)
    for answer in contents.answers:
        typer.echo(f"{answer.claim.id:4} {answer.verdict:12} {answer.claim.claim}")
    if decider:
        typer.echo(decider.table().to_text(terminal_width()))
    typer.echo(page)
    if count := sum(failed.values()):
        typer.echo(f"{counted(count, 'trial')} failed; run the command again to retry them", err=True)
        raise typer.Exit(1)
