"""Users' files inside a run folder, so that somebody else can continue its run; their digests, and trust.

Code in a folder from somebody else does not run until the user trusts it, by its digest.
"""

import hashlib
import os
import re
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import count, starmap
from pathlib import Path
from typing import Any

import platformdirs

from epuck_sim.control.loader import CONTROLLER, find_controller, find_sensor
from epuck_sim.errors import StoreError
from epuck_sim.runs.folder import DATABASE
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import RUN_SCENARIO, SCENARIO, robots_like
from epuck_sim.scenario.particles import ParticleScenario, find_curve
from epuck_sim.scenario.scenario import MeasureSection, Scenario
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.builtin import CONTROLLERS, builtin_folder
from epuck_sim.util.yaml_io import parse_yaml, write_yaml

SOURCES = "sources"
"""Name of the folder for users' files in a run folder; sources-2 and so on for other files of the same names."""

DIGESTS = "SHA256SUMS"
"""Name of the file with the digests of the scenario and of users' files, as `sha256sum -c` reads it."""

NO_FILES = ("name", "description", "figure")  # keys of a scenario whose values are never names of files
CODE = (".py", ".c", ".h", ".so")  # endings of files that are run, or compiled and run

_PARAMETER = re.compile(r"measures\.\d+\.")  # beginning of the key of an axis over a measure's parameter
_trusted: set[str] = set()  # digests of the code that was trusted in this process


def own_files(scenario: Scenario) -> tuple[str, ...]:
    """Return names, with digests, of what a scenario's trials need: controllers, sensors, curve, picture, measures."""
    return tuple(starmap(name_with_digest, _all_sources(scenario)))


NamedSources = tuple[str, Mapping[Path, bytes]]
"""Name of a controller, or another thing that users write, and the contents of its files; none if it is shipped."""


def _all_sources(scenario: Scenario) -> Iterator[NamedSources]:
    yield from named_sources(scenario)
    yield from map(measure_sources, scenario.measures)


def named_sources(scenario: Scenario) -> Iterator[NamedSources]:
    """Yield names and sources of controllers, sensors in files, a floor's picture, a user's response curve.

    For agents that start like robots, the robots' file is one of them; its sources include those of all that it names.
    """
    for name in scenario.controllers:
        yield name, {} if name in CONTROLLER.shipped() else find_controller(name).sources
    if isinstance(scenario, EmbodiedScenario):
        files = (sensor["file"] for group in scenario.robots for sensor in group.sensors.values())
        yield from ((file, find_sensor(file).sources) for file in files)
        if (picture := scenario.arena.floor.picture) is not None:
            yield picture, {Path(picture): Path(picture).read_bytes()}
    if isinstance(scenario, ParticleScenario):
        like = scenario.start.like
        if like is not None and Path(like).is_absolute():  # a user's file
            of_robots = named_sources(robots_like(like, scenario.name))
            yield like, {Path(like): Path(like).read_bytes(), **ChainMap(*(dict(files) for _, files in of_robots))}
        curve = find_curve(scenario.response.curve)
        if curve.sources:
            yield curve.stored_name, curve.sources


def measure_sources(section: MeasureSection) -> NamedSources:
    """Return the name and the sources of a measure."""
    measure = section.find()
    return measure.stored_name, measure.sources


def name_with_digest(path: str, sources: Mapping[Path, bytes]) -> str:
    """Return the name of a file, with the digest of its sources if there are any."""
    digest = f" with digest {_hex(b''.join(sources.values()))[:12]}" if sources else ""
    return Path(path).name + digest


def write_sources(folder: Path, scenario: Scenario, used: Iterable[Scenario]) -> dict[Path, bytes]:
    """Write a scenario and the users' files that it names into a run folder, with paths relative to the folder.

    Returns the contents of these files, by their original paths.
    """
    root, keys = folder.resolve(), scenario.model_dump(mode="json")
    needed = {path: data for each in used for _, files in _all_sources(each) for path, data in files.items()}

    def read(path: Path) -> Path:
        needed.setdefault(path, path.read_bytes())
        return path

    _with_paths(keys, read)
    inside = {path: data for path, data in needed.items() if path.is_relative_to(root)}
    shipped = builtin_folder(CONTROLLERS)  # files of users may import these, which everybody has
    outside = {path: data for path, data in needed.items() if path not in inside and not path.is_relative_to(shipped)}
    places = _free_places(root, outside)
    files = {**inside, **{places[path]: data for path, data in outside.items()}}

    def relative(path: Path) -> Path:
        place = places.get(path, path)
        return place.relative_to(root) if place.is_relative_to(root) else place

    files[root / RUN_SCENARIO] = write_yaml(_with_paths(keys, relative)).encode()
    named = {path.relative_to(root).as_posix(): data for path, data in files.items()}
    was_trusted = is_trusted(folder)
    write_files(folder, {**named, DIGESTS: _sums(named)})
    if was_trusted:  # the code that was added is what this user runs anyway
        trust(folder)
    return needed


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a run folder, by their names in it; skip those that have these contents already."""
    for name, data in files.items():
        path = folder / name
        if not path.is_file() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as part:
                part.write_bytes(data)


def _free_places(root: Path, files: Mapping[Path, bytes]) -> dict[Path, Path]:
    if not files:
        return {}
    common = os.path.commonpath([path.parent for path in files])
    for number in count(1):
        base = root / (SOURCES if number == 1 else f"{SOURCES}-{number}")
        places = {path: base / path.relative_to(common) for path in files}
        if all(not place.exists() or place.read_bytes() == files[path] for path, place in places.items()):
            return places
    raise AssertionError


def _with_paths(keys: Mapping[str, Any], change: Callable[[Path], Path]) -> dict[str, Any]:
    """Return a scenario's keys with the path of each file changed.

    Paths in parameters of measures stay as they are: the measure's own code opens these files.
    """
    measures = [{_map_paths(name, change): given for name, given in each.items()} for each in keys["measures"]]
    named = {key: _map_paths(value, change) for key, value in keys.items() if key not in (*NO_FILES, "measures")}
    return {**keys, **named, "measures": measures}


def _map_paths(value: Any, change: Callable[[Path], Path]) -> Any:
    if isinstance(value, dict):
        pairs = {key: each if _PARAMETER.match(key) else _map_paths(each, change) for key, each in value.items()}
        return {_map_paths(key, change): each for key, each in pairs.items()}
    if isinstance(value, list):
        return [_map_paths(each, change) for each in value]
    if not isinstance(value, str) or not Path(value).is_absolute():
        return value
    for text, rest in ((value, ""), (value.rpartition(":")[0], value[value.rfind(":") :])):
        if text and Path(text).is_file():
            return f"{change(Path(text)).as_posix()}{rest}"
    return value


def read_sources(folder: Path) -> dict[str, bytes]:
    """Return a run folder's scenario, the users' files in it and their digests, by their names."""
    digests = read_digests(folder)
    found = {}
    for name in (RUN_SCENARIO,) if digests is None else (*digests, DIGESTS):
        try:
            found[name] = (folder / name).read_bytes()
        except OSError as error:
            raise StoreError(f"{folder / name}: cannot be read: {error.strerror}; copy it, too") from error
    return found


def with_trials(sources: Mapping[str, bytes], trials: int) -> dict[str, bytes]:
    """Return a run folder's files, with the scenario's number of trials raised to `trials` if it is lower."""
    before = sources.get(RUN_SCENARIO, b"")
    keys = parse_yaml(before.decode("utf-8", "replace"), RUN_SCENARIO)
    has_fewer = isinstance(keys, dict) and isinstance(keys.get("trials"), int) and keys["trials"] < trials
    if not has_fewer:  # nor if a user has written something else there
        return dict(sources)
    after = write_yaml({**keys, "trials": trials}).encode()
    line, new_line = (_sums({RUN_SCENARIO: each}) for each in (before, after))
    digests = {DIGESTS: sources[DIGESTS].replace(line, new_line)} if DIGESTS in sources else {}
    return {**sources, RUN_SCENARIO: after, **digests}


def _hex(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _sums(files: Mapping[str, bytes]) -> bytes:
    return "".join(f"{_hex(data)}  {name}\n" for name, data in files.items()).encode()


def read_digests(folder: Path) -> dict[str, str] | None:
    """Return the digest of each file that should be in a run folder, by its name; None if the folder has none."""
    try:
        text = (folder / DIGESTS).read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(f"{folder / DIGESTS}: cannot be read: {error}") from error
    found = {}
    for line in text.splitlines():
        digest, _, name = line.partition("  ")
        if len(digest) != 64 or not name or not (folder / name).resolve().is_relative_to(folder.resolve()):
            raise StoreError(f"{folder / DIGESTS}: is damaged: {line!r} is no digest of a file in the folder")
        found[name] = digest
    return found


def _trusted_file() -> Path:
    return platformdirs.user_state_path("epuck-sim") / "trusted"


def run_folder_of(scenario: str | Path) -> Path | None:
    """Return the run folder that is given as a scenario, or by its scenario's file; None if it is neither."""
    if str(scenario) in SCENARIO.shipped():
        return None
    path = Path(scenario)
    folder = path.parent if path.name == RUN_SCENARIO else path
    return folder if (folder / DATABASE).is_file() else None


def code_in(folder: Path) -> dict[str, bytes]:
    """Return the code that lies in a run folder, by the names of files in it."""
    files = sorted(path for path in folder.rglob("*") if path.suffix in CODE and path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def is_trusted(folder: Path) -> bool:
    """Return whether a run folder has no code, or code that this user has put there by a run, or has trusted."""
    code = code_in(folder)
    if not code or (digest := _hex(_sums(code))) in _trusted:
        return True
    try:
        return digest in _trusted_file().read_text(encoding="ascii").split()
    except (OSError, UnicodeDecodeError, RuntimeError):  # the last: a user without a home
        return False


def trust(folder: Path) -> None:
    """Trust the code that is in a run folder now; if that cannot be stored, for this process alone."""
    if is_trusted(folder):
        return
    digest = _hex(_sums(code_in(folder)))
    _trusted.add(digest)
    with suppress(OSError, RuntimeError):
        _trusted_file().parent.mkdir(parents=True, exist_ok=True)
        with _trusted_file().open("a", encoding="ascii") as file:
            file.write(f"{digest}\n")


def ask_for_trust(path: Path, *, trusted: bool = False) -> None:
    """Raise StoreError for code in a run folder that its user does not trust; with `trusted`, trust it from now on."""
    folders = path.parents if path.suffix in CODE else ()
    folder = next((each for each in folders if (each / DATABASE).is_file()), None)
    if folder is None:
        return
    if trusted:
        trust(folder)
    if not is_trusted(folder):
        names = ", ".join(code_in(folder))
        advice = "if you trust it, give --trust to `run`, `plan` or `replay`, which then run it as you"
        raise StoreError(f"{folder}: brings code that you have not run: {names}; look at it, and {advice}")
