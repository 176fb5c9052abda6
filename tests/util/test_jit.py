"""The cache of compiled code is named after everything that kernels depend on, and does not grow for ever."""

import ast
import errno
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from numba import njit

from epuck_sim.util import jit, machine
from epuck_sim.util.cache_folder import UNUSED_S, remove_unused
from epuck_sim.util.jit import PACKAGE, Kernel, digest, is_cache, kernel_digest, kernel_files
from epuck_sim.util.native import unlikely

MARK = "epuck_sim.util.jit import"

# --- what the digest covers ---------------------------------------------------------------------------


@lru_cache
def definitions(file: Path) -> dict[str, list[ast.AST]]:
    """Return what defines each name at a file's top level."""
    found: dict[str, list[ast.AST]] = {}
    for node in ast.parse(file.read_text()).body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.asname or alias.name for alias in node.names]
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names = [node.name]
        else:
            stored = [each for each in ast.walk(node) if isinstance(each, ast.Name)]
            names = [each.id for each in stored if isinstance(each.ctx, ast.Store)]
        for name in names:
            found.setdefault(name, []).append(node)
    return found


def without_annotations(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and all inside it but annotations, which are not compiled."""
    yield node
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns"):
            continue
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, ast.AST):
                yield from without_annotations(each)


def file_of(module: str) -> Path:
    path = PACKAGE.parent.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def sources_of(file: Path, name: str, seen: set[tuple[Path, str]]) -> None:
    """Add to `seen` where in the package `name` gets its value from, and what that depends on."""
    if (file, name) in seen or name not in definitions(file):
        return
    seen.add((file, name))
    for node in definitions(file)[name]:
        if isinstance(node, ast.ImportFrom):
            if (node.module or "").startswith("epuck_sim"):
                (alias,) = (each for each in node.names if (each.asname or each.name) == name)
                as_module = file_of(f"{node.module}.{alias.name}")
                if as_module.exists():  # any of its names may be meant
                    for each in definitions(as_module):
                        sources_of(as_module, each, seen)
                else:
                    sources_of(file_of(node.module), alias.name, seen)
        elif not isinstance(node, ast.Import):
            for inner in without_annotations(node):
                if isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Load):
                    sources_of(file, inner.id, seen)


def room_of(file: Path) -> str:
    return file.relative_to(PACKAGE).parts[0]


def kernels() -> dict[str, set[tuple[Path, str]]]:
    """Return, for each room, the file and name of every compiled function of the package."""
    runner = PACKAGE / "embodied" / "controllers.py"
    found = {"embodied": {(runner, "run_group")}}  # compiled with each controller
    for file in PACKAGE.rglob("*.py"):
        if MARK in file.read_text() or "njit" in file.read_text():
            module = import_module(".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts))
            for value in vars(module).values():
                if isinstance(value, Kernel):
                    code = value.function.__code__
                    kernel = Path(code.co_filename), code.co_name
                    found.setdefault(room_of(kernel[0]), set()).add(kernel)
    return found


def test_every_value_that_a_kernel_refers_to_comes_from_a_file_that_the_digest_covers() -> None:
    rooms = kernels()
    assert sum(map(len, rooms.values())) > 50
    for room, functions in rooms.items():
        seen: set[tuple[Path, str]] = set()
        for file, name in functions:
            assert name in definitions(file)
            sources_of(file, name, seen)
        covered = set(kernel_files(room))
        outside = {f"{file.relative_to(PACKAGE)}: {name}" for file, name in seen if file not in covered}
        # `jit` itself, and where it keeps compiled code, is no value of a kernel
        free = ("util/jit.py", "util/cache_folder.py", "util/machine.py", "arrays.py")
        assert {each for each in outside if not each.startswith(free)} == set(), room


def test_the_check_above_finds_a_constant_in_a_file_that_is_not_covered() -> None:
    seen: set[tuple[Path, str]] = set()
    sources_of(PACKAGE / "runs" / "share.py", "merge_folders", seen)
    assert (PACKAGE / "runs" / "folder.py", "DATABASE") in seen
    assert PACKAGE / "runs" / "folder.py" not in kernel_files("embodied")


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package's sources."""
    return Path(shutil.copytree(PACKAGE, tmp_path / "epuck_sim", ignore=shutil.ignore_patterns("__pycache__")))


ROOMS = ("embodied", "particles")


@pytest.mark.parametrize(
    ("file", "rooms"),
    [
        *((file, []) for file in ("errors.py", "trial/result.py", "cli/app.py", "scenario/scenario.py")),
        ("epuck.py", ROOMS),
        ("util/rng.py", ROOMS),
        ("util/native.py", ROOMS),
        ("control/interface.py", ROOMS),
        ("embodied/swarm.py", ["embodied"]),
        ("embodied/sensors/infrared.py", ["embodied"]),
        ("particles/events.py", ["particles"]),
    ],
)
def test_an_edit_compiles_the_rooms_anew_that_use_what_was_edited(package: Path, file: str, rooms) -> None:
    with (package / file).open("a") as source:
        source.write("\nMORE = 1\n")
    assert [room for room in ROOMS if kernel_digest(room, package) != kernel_digest(room)] == list(rooms)


def test_the_digest_depends_on_where_one_content_ends_and_the_next_begins() -> None:
    assert digest([b"ab", b"c"]) != digest([b"a", b"bc"])


# --- old caches ----------------------------------------------------------------------------------------


OLD, RECENT = UNUSED_S + 100, UNUSED_S - 100


def make_cache(folder: Path, age_s: float, file: str = "infrared.read-1.py311.1.nbc") -> Path:
    (folder / "embodied_0123").mkdir(parents=True)
    (folder / "embodied_0123" / file).write_bytes(b"code")
    now = time.time()
    os.utime(folder, (now - age_s, now - age_s))
    return folder


def test_a_cache_that_was_not_used_for_a_month_is_removed_but_nothing_that_may_be_another_program_s(tmp_path) -> None:
    make_cache(tmp_path / "0123456789abcdef", OLD)
    strangers = ("0123456789ABCDEF", "0123456789abcde", "0123456789abcdef0", "particles_0123456789")
    kept = [make_cache(tmp_path / name, OLD, "x.nbi") for name in strangers]
    kept.append(make_cache(tmp_path / "0123456789abcde0", RECENT))
    kept.append(make_cache(tmp_path / "0123456789abcde1", OLD, "thesis.txt"))
    remove_unused(tmp_path.iterdir(), is_cache)
    assert set(tmp_path.iterdir()) == set(kept)
    assert all(list(folder.rglob("*.*")) for folder in kept)
    (tmp_path / "firmware.so").touch()
    os.utime(tmp_path / "firmware.so", (0, 0))
    remove_unused(tmp_path.iterdir(), Path.is_file)
    assert set(tmp_path.iterdir()) == set(kept)


def test_another_user_s_cache_a_link_and_a_file_stay(tmp_path, monkeypatch) -> None:
    elsewhere, root = make_cache(tmp_path / "elsewhere", OLD), tmp_path / "root"
    root.mkdir()
    (root / "0123456789abcde1").symlink_to(elsewhere)
    (root / "0123456789abcde2").write_text("a file")
    for path in root.iterdir():
        os.utime(path, (0, 0), follow_symlinks=False)
    remove_unused(root.iterdir(), is_cache)
    make_cache(root / "0123456789abcde3", OLD)
    monkeypatch.setattr(machine, "USER", os.getuid() + 1)
    remove_unused(root.iterdir(), is_cache)
    assert len(list(root.iterdir())) == 3
    assert elsewhere.exists()


ADD_ONE = """
import sys
from epuck_sim.util.jit import compile_cached
def plus_one(value):
    return value + 1
compiled = compile_cached(plus_one, "0123456789abcdef", careful=False)
print(compiled(1), sum(compiled.stats.cache_hits.values()))
"""


def in_processes(cache: Path, program: Path, count: int) -> list[str]:
    """Return what some processes print that run the program at the same time, with a cache."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(PACKAGE.parent)}
    running = [
        subprocess.Popen([sys.executable, program], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(count)
    ]
    return [process.communicate(timeout=120)[0].strip() for process in running]


def test_a_cache_in_use_is_marked_so_and_old_ones_go_when_a_new_one_is_made(tmp_path) -> None:
    program = tmp_path / "program.py"
    program.write_text(ADD_ONE)
    cache = tmp_path / "cache"
    old, used = make_cache(cache / ("0" * 16), OLD), cache / "0123456789abcdef"
    assert in_processes(cache, program, 2)[0].startswith("2 ")  # both at once make it
    assert not old.exists()
    old = make_cache(cache / ("0" * 16), OLD)
    os.utime(used, (0, 0))
    assert in_processes(cache, program, 1) == ["2 1"]
    assert time.time() - used.stat().st_mtime < 100
    assert old.exists()  # nothing was compiled: there was no need to look


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """Return a function that compiles one into a cache, an empty folder at first."""
    monkeypatch.setattr(jit, "cache_root", lambda **_: tmp_path)

    def compile_one() -> Any:
        def plus_two(value: int) -> int:
            return value + 2

        return jit.compile_cached(plus_two, "0123456789abcdef", careful=False)

    return compile_one


def test_a_cache_that_is_removed_while_it_is_in_use_is_made_anew(tmp_path, compiled) -> None:
    plus_two = compiled()
    os.utime(tmp_path / "0123456789abcdef", (0, 0))
    remove_unused(tmp_path.iterdir(), is_cache)
    assert list(tmp_path.iterdir()) == []
    assert plus_two(1) == 3
    assert list(tmp_path.rglob("*.nbi")) != []


def test_files_of_the_cache_that_were_damaged_are_compiled_anew_and_healed(tmp_path, compiled) -> None:
    def is_from_cache() -> bool:
        plus_two = compiled()
        assert plus_two(1) == 3
        return sum(plus_two.stats.cache_hits.values()) == 1

    assert [is_from_cache(), is_from_cache()] == [False, True]
    index, code = sorted(tmp_path.rglob("*.nb*"), key=lambda path: path.suffix, reverse=True)
    assert (index.suffix, code.suffix) == (".nbi", ".nbc")
    generator = random.Random(4)
    for file in [index, code] * 6:
        contents = file.read_bytes()
        place = generator.randrange(len(contents))
        flipped = contents[:place] + bytes([contents[place] ^ 4]) + contents[place + 1 :]
        for damaged in (contents[:place], flipped, b""):
            file.write_bytes(damaged)
            assert [is_from_cache(), is_from_cache()] == [False, True]


def test_a_cache_that_gets_full_costs_a_warning_not_the_run(tmp_path, monkeypatch, compiled) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.EDQUOT, "Disk quota exceeded")

    plus_two = compiled()
    monkeypatch.setattr("numba.core.caching.os.replace", full)
    with pytest.warns(UserWarning, match=rf"{tmp_path}: compiled code cannot be kept here.*: Disk quota exceeded"):
        assert plus_two(1) == 3


# --- how kernels are compiled -------------------------------------------------------------------------


def test_what_is_unlikely_happens_all_the_same() -> None:
    @njit
    def which(number: float) -> str:
        return "unlikely" if unlikely(number > 1) else "likely"

    assert [which(number) for number in (0.0, 2.0)] == ["likely", "unlikely"]
