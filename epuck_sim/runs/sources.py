"""Users' files inside a run folder, which so can be sent to somebody and run on; and the digests of what is in it."""

import hashlib
import os
from collections.abc import Callable, Iterable, Mapping
from itertools import count
from pathlib import Path
from typing import Any

from epuck_sim.errors import StoreError
from epuck_sim.runs.compatibility import own_sources
from epuck_sim.runs.trust import is_trusted, trust
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.yaml_io import write_yaml
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.builtin import CONTROLLERS, builtin_folder

SOURCES = "sources"
"""Name of the folder for users' files in a run folder; sources-2 and so on for other files of the same names."""

DIGESTS = "SHA256SUMS"
"""Name of the file with the digests of the scenario and of users' files, as `sha256sum -c` reads it."""

NO_FILES = ("name", "description", "figure")
"""Keys of a scenario that name no files, whatever they say."""


def write_sources(folder: Path, scenario: Scenario, used: Iterable[Scenario]) -> None:
    """Write a scenario into a run folder, with the users' files that it names, by paths relative to the folder.

    Args:
        folder: The run folder.
        scenario: The scenario.
        used: A scenario without a sweep for each set of users' files.

    Raises:
        EpuckSimError: A file cannot be read or written.
    """
    root, needed = folder.resolve(), {path: data for each in used for path, data in own_sources(each).items()}
    keys = scenario.model_dump(mode="json")

    def read(path: Path) -> Path:
        needed.setdefault(path, path.read_bytes())
        return path

    _map_paths(keys, read)
    inside = {path: data for path, data in needed.items() if path.is_relative_to(root)}
    shipped = builtin_folder(CONTROLLERS)  # which files of users may import, and everybody has
    outside = {path: data for path, data in needed.items() if path not in inside and not path.is_relative_to(shipped)}
    places = _free_places(root, outside)
    files = {**inside, **{places[path]: data for path, data in outside.items()}}

    def relative(path: Path) -> Path:
        place = places.get(path, path)
        return place.relative_to(root) if place.is_relative_to(root) else place

    files[root / RUN_SCENARIO] = write_yaml(_map_paths(keys, relative)).encode()
    named = {path.relative_to(root).as_posix(): data for path, data in files.items()}
    digests = "".join(f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in named.items())
    was_trusted = is_trusted(folder)
    write_files(folder, {**named, DIGESTS: digests.encode()})
    if was_trusted:  # all code in it is now what this user has run anyway
        trust(folder)


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a run folder, by their names in it, but for those that have these contents already."""
    for name, data in files.items():
        path = folder / name
        if not path.is_file() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as part:
                part.write_bytes(data)


def _free_places(root: Path, files: Mapping[Path, bytes]) -> dict[Path, Path]:
    """Return where files come to lie in a run folder: beside each other as they are, and on no other file."""
    if not files:
        return {}
    common = os.path.commonpath([path.parent for path in files])
    for number in count(1):
        base = root / (SOURCES if number == 1 else f"{SOURCES}-{number}")
        places = {path: base / path.relative_to(common) for path in files}
        if all(not place.exists() or place.read_bytes() == files[path] for path, place in places.items()):
            return places
    raise AssertionError


def _map_paths(value: Any, change: Callable[[Path], Path], *, is_top: bool = True) -> Any:
    """Return a scenario's keys in which the path of each file has been changed; FILE.py:NAME is one, too."""
    if isinstance(value, dict):
        return {
            _map_paths(key, change): each if is_top and key in NO_FILES else _map_paths(each, change, is_top=False)
            for key, each in value.items()
        }
    if isinstance(value, list):
        return [_map_paths(each, change, is_top=False) for each in value]
    if not isinstance(value, str) or not Path(value).is_absolute():
        return value
    for text, rest in ((value, ""), (value.rpartition(":")[0], value[value.rfind(":") :])):
        if text and Path(text).is_file():
            return f"{change(Path(text)).as_posix()}{rest}"
    return value


def read_sources(folder: Path) -> dict[str, bytes]:
    """Return a run folder's scenario, the users' files in it and their digests, by their names.

    Raises:
        StoreError: One of them is missing.
    """
    digests = read_digests(folder)
    found = {}
    for name in (RUN_SCENARIO,) if digests is None else (*digests, DIGESTS):
        try:
            found[name] = (folder / name).read_bytes()
        except OSError as error:
            raise StoreError(f"{folder / name}: cannot be read: {error.strerror}; copy it, too") from error
    return found


def read_digests(folder: Path) -> dict[str, str] | None:
    """Return the digest of each file that should be in a run folder, by its name; None if the folder has none.

    Raises:
        StoreError: They are damaged.
    """
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
