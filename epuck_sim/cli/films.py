"""The commands of films: `film`, `calibrate`, `track` and `compare-film`."""

import math
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from epuck_sim.cli import options
from epuck_sim.cli.errors import note_if_slow, print_stderr, reject_first
from epuck_sim.cli.options import argument, option, output_option
from epuck_sim.errors import FilmError

films = typer.Typer()

LEAST_ORDER = 0.5  # least order parameter that may count as that of synchrony; a swarm at random often has less

film_option, geometry_option, decision_option, camera_option = options.options_of(
    "Film", "Geometry", "Decision", "Live camera"
)

NUMBER = r"\s*(-?[0-9]*\.?[0-9]+)\s*"


def parse_arena(text: str) -> tuple[float, float]:
    """Return width and height, in cm, of a floor given as SIDE or WIDTHxHEIGHT; raises FilmError for anything else."""
    match = re.fullmatch(f"{NUMBER}(?:x{NUMBER})?", text)
    sides = [float(side) for side in match.groups() if side is not None] if match else []
    if not sides or not all(1 <= side <= 1e6 for side in sides):
        raise FilmError(f"--arena-cm is {text}; allowed: a side of 1 to 1000000 cm, such as 60, or two, such as 60x100")
    return sides[0], sides[-1]


def parse_corners(text: str) -> tuple[tuple[float, float], ...]:
    """Return the pixels of four corners given as X,Y,X,Y,X,Y,X,Y; raises FilmError for anything else."""
    numbers = re.fullmatch(",".join([NUMBER] * 8), text)
    if numbers is None:
        raise FilmError(f"--corners is {text}; allowed: four corners in pixels, such as 10,12,470,11,468,470,12,469")
    values = [float(value) for value in numbers.groups()]
    return tuple(zip(values[::2], values[1::2], strict=True))


def parse_board(text: str) -> tuple[int, int]:
    """Return the squares across and down a board given as COLUMNSxROWS; raises FilmError for anything else."""
    match = re.fullmatch(r"([0-9]+)x([0-9]+)", text)
    squares = tuple(map(int, match.groups())) if match else ()
    if len(squares) != 2 or not all(4 <= number <= 40 for number in squares):
        raise FilmError(f"--board is {text}; allowed: squares across and down, each 4 to 40, such as 9x6")
    return squares[0], squares[1]


def parse_tags(text: str) -> dict[str, Any]:
    """Return the dictionary of tags, and the numbers in use, if given; raises FilmError for anything else."""
    from epuck_sim.scenario.arena import TagDictionary

    match = re.fullmatch(r"([4-7]X[4-7]_[0-9]+)(?::([0-9]+(?:-[0-9]+)?(?:,[0-9]+(?:-[0-9]+)?)*))?", text)
    names = get_args(TagDictionary)
    if match is None or match[1] not in names:
        allowed = f"a dictionary, {', '.join(names)}, and numbers if you want: 4X4_50:0-9,12"
        raise FilmError(f"--tags is {text}; allowed: {allowed}")
    name, given = match.groups()
    count = int(name.partition("_")[2])
    spans = [[int(end) for end in span.split("-")] for span in (given or "").split(",") if span]
    if any(span[0] > span[-1] or span[-1] >= count for span in spans):
        raise FilmError(f"--tags is {text}; allowed: numbers from 0 to {count - 1}, and ranges that rise, as in 0-9")
    numbers = frozenset(number for span in spans for number in range(span[0], span[-1] + 1))
    return {"tags": name, "tag_numbers": numbers or None}


ArenaOption = Annotated[
    Any,
    geometry_option(
        "--arena-cm SIDE|WIDTHxHEIGHT",
        "Size of the floor; by default as the film describes it, or as in SCENARIO, or 60.",
        parser=parse_arena,
    ),
]
HeightOption = Annotated[
    float | None,
    geometry_option(
        "--height-cm CM", "Height of the camera above the floor; by default 110 for a side of 60.", min=10, max=100_000
    ),
]
CornersOption = Annotated[
    Any,
    geometry_option(
        "--corners X,Y,X,Y,X,Y,X,Y",
        "The floor's four corners, in any order, in pixels from the upper left.",
        parser=parse_corners,
    ),
]
LensOption = Annotated[Path | None, geometry_option("FILE.json", "The lens of the camera, written by `calibrate`.")]
TagsOption = Annotated[
    Any,
    film_option(
        "DICTIONARY[:NUMBERS]",
        "Tell robots apart by the ArUco tags on top of them: 4X4_50, or 4X4_50:0-9 if no others are there.",
        parser=parse_tags,
    ),
]
FpsOption = Annotated[
    float | None, film_option("N", "Frames per second, instead of the film's time stamps.", min=0.1, max=10_000)
]
PeriodOption = Annotated[
    float | None,
    decision_option(
        "--period-s S",
        "Period of the oscillators; by default as the film describes it, or estimated.",
        min=0.1,
        max=86_400,
    ),
]
RobotsOption = Annotated[
    int | None,
    decision_option(
        "N",
        "Number of robots; by default as the film describes it. T_sync is unknown if the flashes do not fit it.",
        min=1,
    ),
]


@films.command()
def film(
    recording: Annotated[Path, argument("RECORDING", "FILE.rrd of a trial, made by `run --record`.")],
    to: Annotated[Path, argument("FILE.mp4", "The film: H.264, which any browser plays.")],
    settings: Annotated[
        list[str] | None, option("--set KEY=VALUE", "Change the camera, as in light=lit; repeatable.")
    ] = None,
    lens: Annotated[Path | None, option("FILE.json", "Film through this lens, written by `calibrate`.")] = None,
) -> None:
    """Film a recorded trial with the webcam above the arena: lit rings in the dark, or everything in a lit room."""
    from epuck_sim.overhead.filming import film_recording

    film_recording(recording, settings or (), to, progress_bar("filming"), lens)


@films.command()
def calibrate(
    film: Annotated[str, argument("FILM", "A film or numbered pictures of a board that is moved.")],
    to: Annotated[Path, argument("FILE.json", "The lens, for `track --lens` and `film --lens`.")],
    board: Annotated[str, option("COLUMNSxROWS", "Number of squares across and down the board.")] = "9x6",
    charuco: Annotated[
        bool, option("--charuco", "A ChArUco board (dictionary 5X5_100) instead of a checkerboard.")
    ] = False,
    fisheye: Annotated[bool, option("--fisheye", "A fisheye lens, wider than about 120 degrees.")] = False,
) -> None:
    """Calibrate the lens of a camera from a film of a checkerboard or ChArUco board."""
    from epuck_sim.overhead.camera import APART_S, calibrate_lens, find_views, save_lens
    from epuck_sim.overhead.film import open_film

    squares = parse_board(board)
    options.check_outputs({"the film": film}, {"the lens": (to, [".json"])}, {})
    with open_film(film) as reader:
        frames = progress_bar("calibrating")(reader.frames(), reader.duration_s)
        views = find_views(frames, squares, charuco, 0.0 if reader.is_pictures else APART_S)
        lens = calibrate_lens(film, views, (reader.width_px, reader.height_px), fisheye)
    save_lens(to, lens)
    typer.echo(f"{to}: focal length {lens.focal_px:.1f} px, from {lens.views} views, error {lens.error_px:.2f} px")


@films.command()
def track(
    film: Annotated[str | None, argument("FILM", "The file of a film, of any format, or its URL.")] = None,
    camera: Annotated[
        int | None, film_option("N", "Track a live camera instead, until synchrony or Ctrl-C.", min=0)
    ] = None,
    web: Annotated[
        bool, camera_option("--web", "Show what --camera sees, with rings and histogram, in a browser.")
    ] = False,
    port: options.PortOption = None,
    record: Annotated[Path | None, camera_option("FILE.mp4", "Save what --camera sees, to track it again.")] = None,
    start_s: Annotated[
        float, film_option("--start-s S", "Leave out frames before this time on the film's clock.", min=0)
    ] = 0.0,
    end_s: Annotated[
        float | None, film_option("--end-s S", "Leave out frames after this time on the film's clock.", min=0)
    ] = None,
    fps: FpsOption = None,
    arena_cm: ArenaOption = None,
    height_cm: HeightOption = None,
    corners_px: CornersOption = None,
    lens: LensOption = None,
    tags: TagsOption = None,
    period_s: PeriodOption = None,
    robots: RobotsOption = None,
    threshold_ms: Annotated[
        float | None,
        decision_option(
            "--threshold-ms MS",
            "Histogram: standard deviation of a period's flashes at synchrony; by default about 130 for 5 s.",
            min=1,
            max=86_400_000,
        ),
    ] = None,
    order_parameter: Annotated[
        float | None,
        decision_option(
            "--order-parameter R",
            "T_sync: order parameter from which the swarm is synchronised; by default 0.95.",
            min=LEAST_ORDER,
            max=1,
        ),
    ] = None,
    as_json: options.JsonOption = False,
    plot: Annotated[
        Path | None, output_option("FILE.png", "Draw the histogram over time; its table is written beside it as .csv.")
    ] = None,
    rings: Annotated[
        Path | None, output_option("FILE.csv", "Write the position and size of every ring in every frame.")
    ] = None,
    flashes: Annotated[
        Path | None, output_option("FILE.csv|.parquet", "Write time, duration, place and robot of each flash.")
    ] = None,
    trace: Annotated[
        Path | None,
        output_option(
            "FILE.parquet|.csv", "Write a row for each robot and frame, with columns named as in `run --trace`."
        ),
    ] = None,
    pairs: Annotated[
        Path | None, output_option("FILE.csv|.parquet", "Write how often each pair of robots flashes together.")
    ] = None,
    annotate: Annotated[
        Path | None, output_option("FILE.mp4", "Write the film with the rings found and the histogram drawn.")
    ] = None,
) -> None:
    """Count the lit rings in FILM, frame by frame, and report when the swarm was synchronised (thesis 4.3.1)."""
    is_live = camera is not None
    unknown = "the period cannot be estimated while the camera films"
    reject_first(
        ((film is None) != is_live, "give either a film or --camera NUMBER"),
        (end_s is not None and end_s <= start_s, "--end-s is not after --start-s"),
        (is_live and any((start_s, end_s, fps, tags)), "--camera excludes --start-s, --end-s, --fps, --tags"),
        (not is_live and (web or record is not None), "--web and --record are for --camera"),
        (port is not None and not web, "--port is for --web"),
        (is_live and period_s is None, f"--camera needs --period-s, because {unknown}"),
    )
    from epuck_sim.cli.tables import print_track
    from epuck_sim.overhead.calibration import TrackOptions
    from epuck_sim.overhead.robots import find_robots
    from epuck_sim.overhead.track import look_again, track_film

    scene = TrackOptions(arena_cm, height_cm, corners_px, period_s, robots, threshold_ms, order_parameter, lens)
    scene = scene._replace(start_s=start_s, end_s=math.inf if end_s is None else end_s, fps=fps, **(tags or {}))
    tables = {"--flashes": flashes, "--trace": trace, "--pairs": pairs}
    outputs = {
        "--plot": (plot, [".png"]),
        "--rings": (rings, [".csv"]),
        **{option: (path, [".csv", ".parquet"]) for option, path in tables.items()},
        "--annotate": (annotate, [".mp4"]),
        "--record": (record, [".mp4"]),
    }
    inputs = {} if film is None else {"the film": film}
    options.check_outputs(inputs, outputs, {} if plot is None else {"--plot": [plot, plot.with_suffix(".csv")]})
    if camera is not None and period_s is not None:
        from epuck_sim.overhead.live import Watching, track_camera

        watching = Watching(record, rings, annotate, (port or options.WEB_PORT) if web else None)
        tracked = track_camera(camera, scene, watching, progress_bar("tracking"), print_stderr)
    else:
        assert film is not None  # otherwise it was refused above
        tracked = track_film(film, scene, rings, progress_bar("tracking"))
    robots_found = find_robots(tracked) if tags is not None or any(tables.values()) else None
    print_doubts((*tracked.warnings, *(robots_found.warnings if robots_found else ())))
    print_track(tracked, robots_found, as_json=as_json)
    if robots_found is not None:
        robots_found.save(flashes, trace, pairs)
    shown = None
    if not is_live and (annotate or plot):
        shown = look_again(tracked, annotate, progress_bar("annotating" if annotate else "drawing"))
    if plot is not None:
        from epuck_sim.figures.films import save_track_figure

        save_track_figure(plot, tracked, shown)


@films.command("compare-film")
def compare_film(
    film: Annotated[str, argument("FILM", "The file of a film, of any format, or its URL.")],
    scenario: options.ScenarioArgument,
    settings: options.SetOption = None,
    trials: Annotated[int, option("N", "Number of simulated trials.", min=1, max=10_000)] = 40,
    fps: FpsOption = None,
    arena_cm: ArenaOption = None,
    height_cm: HeightOption = None,
    corners_px: CornersOption = None,
    lens: LensOption = None,
    tags: TagsOption = None,
    period_s: PeriodOption = None,
    robots: RobotsOption = None,
    as_json: options.JsonOption = False,
    plot: Annotated[
        Path | None,
        output_option(
            "STEM|FILE",
            "Draw the film beside the trials, as STEM.png and STEM.svg or one picture, FILE.png, FILE.svg or "
            "FILE.pdf, with all values as CSV beside it.",
        ),
    ] = None,
    fit: Annotated[
        Path | None, output_option("FILE.yaml", "Write the scenario with robots fitted to the film.")
    ] = None,
) -> None:
    """Compare T_sync, flashes, speeds and clocks in FILM with their distributions in simulated trials.

    Arena, robots and period are as in SCENARIO unless options, or the film's description, tell them.
    """
    from epuck_sim.cli.tables import print_comparison
    from epuck_sim.overhead import compare
    from epuck_sim.overhead.calibration import FilmMetadata, TrackOptions
    from epuck_sim.overhead.filming import describe_film
    from epuck_sim.overhead.robots import find_robots
    from epuck_sim.overhead.track import track_film
    from epuck_sim.scenario.embodied import EmbodiedScenario
    from epuck_sim.scenario.scenario import require_model

    swapped = f"{scenario}: is a film, not a scenario; give FILM first, then SCENARIO"
    reject_first((scenario.lower().endswith((".mp4", ".mkv", ".avi", ".mov", ".webm", ".gif")), swapped))
    loaded = require_model(options.read_scenario(scenario, settings), EmbodiedScenario, "a film needs model: embodied")
    reject_first((loaded.sweep is not None, f"{scenario}: is a sweep; allowed: a scenario without `sweep`"))
    scene = TrackOptions(arena_cm, height_cm, corners_px, period_s, robots, lens=lens, fps=fps, **(tags or {}))
    files = {}
    if plot is not None:
        from epuck_sim.figures.saving import check_files, parse_target

        stem, formats = parse_target(plot)
        files["--plot"] = check_files(stem, (*formats, ".csv"))
    outputs = {"--plot": (plot, None), "--fit": (fit, [".yaml", ".yml"])}
    options.check_outputs({"the film": film, "SCENARIO": scenario}, outputs, files)
    one = f"{loaded.name}: has {len(loaded.robots)} groups of robots; allowed: one, to fit it to a film"
    reject_first((fit is not None and len(loaded.robots) > 1, one))
    simulated_cm = (loaded.arena.width_cm, loaded.arena.height_cm)
    track = track_film(film, scene, None, progress_bar("tracking"), FilmMetadata.of(describe_film(loaded, loaded.seed)))
    found = find_robots(track)
    floor_cm = track.geometry.floor_cm
    doubts = [*(track.reasons if track.confidence == "none" else ()), *track.warnings, *found.warnings]
    if floor_cm != simulated_cm:
        shown, other = (f"{width_cm:g} x {height_cm:g} cm" for width_cm, height_cm in (floor_cm, simulated_cm))
        said = f"the film's floor is {shown}, that of {loaded.name} {other}"
        doubts.append(f"{said}; if they should be the same, check --arena-cm or SCENARIO")
    seen, count = track.options.robots or track.robots_seen, loaded.population
    if seen > count or track.options.robots not in (None, count):
        doubts.append(f"the film shows {seen} robots, {loaded.name} has {count}")
    print_doubts(doubts)
    bar = progress_bar("simulating", "{task.completed} of {task.total} trials", lambda number: number + 1)
    rows = compare.compare_film(found, loaded, trials, lambda numbers: bar(numbers, trials))
    fitted = compare.fitted_values(loaded, found)
    print_comparison(track, loaded.name, rows, fitted, as_json=as_json)
    if fit is not None:
        compare.save_fitted(fit, loaded, fitted, film)
    if plot is not None:
        from epuck_sim.figures.films import save_comparison_figure

        save_comparison_figure(plot, rows)


def print_doubts(doubts: Iterable[str]) -> None:
    """Print doubts on stderr, as warnings."""
    for doubt in doubts:
        print_stderr(f"warning: {doubt}")


def progress_bar(
    doing: str,
    said: str = "{task.completed:.0f} s of film",
    completed: Callable[[Any], float] = lambda timed: getattr(timed, "time_s", timed),
) -> Callable[[Iterable[Any], float | None], Iterator[Any]]:
    """Return a wrapper of frames, times or other items, and their end, that shows progress on a terminal's stderr."""

    def passed(items: Iterable[Any], end: float | None) -> Iterator[Any]:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        console = Console(stderr=True)
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn(said))
        note = nullcontext() if console.is_terminal else note_if_slow(doing)
        with note, Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
            task = progress.add_task(doing, total=end)
            for each in items:
                progress.update(task, completed=completed(each))
                yield each

    return passed
