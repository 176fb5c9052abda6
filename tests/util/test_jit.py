"""The cache of compiled code is named after all that kernels depend on, lies in folders of the user or comes with a
release, and does not grow for ever."""

import ast
import errno
import os
import random
import runpy
import shutil
import stat
import subprocess
import sys
import tempfile
import time
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import platformdirs
import pytest
from numba import njit

from epuck_sim.embodied.swarm import Swarm, make_block
from epuck_sim.runs.sources import is_trusted, trust
from epuck_sim.util import cache_folder, jit, native
from epuck_sim.util.cache_folder import ROOM_BYTES, UNUSED_S, USER, cache_root, fleeting_root, is_kept, remove_unused
from epuck_sim.util.jit import PACKAGE, digest, is_cache, kernel_digest, kernel_files
from epuck_sim.util.native import WITHOUT_WRAPPERS, carve, unlikely
from tests.tools import no_file_larger_than

BOUND = {"run_group", "run_sensor", "shift_at"}  # which are compiled with users' files
FREE = {PACKAGE / "util" / name for name in ("jit.py", "cache_folder.py")} | {PACKAGE / "arrays.py"}
"""`jit` itself, and where it keeps compiled code, are no values of a kernel."""


def file_of(module: str) -> Path:
    path = PACKAGE.parent.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def sources_of(file: Path, *functions: str) -> dict[str, Path]:
    """Return in which files of the package begins what kernels, or functions, of a file refer to, by name."""
    module = vars(import_module(".".join(("epuck_sim", *file.relative_to(PACKAGE).with_suffix("").parts))))
    named = [module[name] for name in {*BOUND, *functions} & module.keys()]
    named += [each.function for each in module.values() if isinstance(each, jit.Kernel)]
    todo = [name for function in named if function.__globals__ is module for name in function.__code__.co_names]
    imported: dict[str, Path] = {}
    made_from: dict[str, list[str]] = {}
    for node in ast.parse(file.read_text()).body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("epuck_sim"):
            for alias in node.names:
                as_module = file_of(f"{node.module}.{alias.name}")
                imported[alias.asname or alias.name] = as_module if as_module.exists() else file_of(node.module or "")
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            read = [each.id for each in ast.walk(node) if isinstance(each, ast.Name)]
            stored = [each for each in ast.walk(node) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)]
            made_from |= {each.id: read for each in stored}
    seen: set[str] = set()
    while todo:
        if (name := todo.pop()) not in seen:
            seen.add(name)
            todo += made_from.get(name, [])
    return {name: imported[name] for name in seen & imported.keys()}


def test_every_value_that_a_kernel_refers_to_comes_from_a_file_that_the_digest_covers() -> None:
    kernels = [path for path in PACKAGE.rglob("*.py") if "epuck_sim.util.jit import" in path.read_text()]
    rooms = {path.relative_to(PACKAGE).parts[0] for path in kernels}
    assert len(rooms) > 5
    for room in rooms:
        covered, found = set(kernel_files(room)), 0
        for file in covered:
            sources = sources_of(file)
            found += len(sources)
            assert {name for name, source in sources.items() if source not in covered | FREE} == set(), file
        assert found
    # the check finds a constant in a file that is not covered
    found = sources_of(PACKAGE / "runs" / "compatibility.py", "merge_folders")
    assert found["DATABASE"] == PACKAGE / "runs" / "folder.py"
    assert found["DATABASE"] not in kernel_files("embodied")


def test_an_edit_compiles_the_rooms_anew_that_use_it_and_kernels_are_kept_under_their_digest(tmp_path, monkeypatch):
    package = Path(shutil.copytree(PACKAGE, tmp_path / "copy", ignore=shutil.ignore_patterns("__pycache__")))
    rooms = ["embodied", "particles"]
    for file, expected in (
        *((file, []) for file in ("errors.py", "trial/result.py", "cli/app.py", "scenario/scenario.py")),
        *((file, rooms) for file in ("epuck.py", "util/rng.py", "util/native.py", "control/interface.py")),
        *((f"embodied/{file}.py", ["embodied"]) for file in ("swarm", "sensors/infrared")),
        ("particles/events.py", ["particles"]),
    ):
        before = (package / file).read_text()
        (package / file).write_text(f"{before}\nMORE = 1\n")
        kernel_digest.cache_clear()
        assert [room for room in rooms if kernel_digest(room, package) != kernel_digest(room)] == expected, file
        (package / file).write_text(before)

    def kernel() -> int:
        return 1

    monkeypatch.setattr(native, "compile_cached", lambda _, contents_digest, **__: contents_digest)
    for module in ("epuck_sim.embodied.sensors.camera", "tests.embodied.sensors.test_sight"):
        kernel.__module__ = module
        assert jit.jit(kernel).for_python == kernel_digest("embodied")
    # which depends on where one content ends and the next begins
    assert digest([b"ab", b"c"]) != digest([b"a", b"bc"])


OLD, RECENT = UNUSED_S + 100, UNUSED_S - 100


def make_cache(folder: Path, age_s: float, file: str = "infrared.read-1.py311.1.nbc") -> Path:
    (folder / "embodied_0123").mkdir(parents=True)
    (folder / "embodied_0123" / file).write_bytes(b"code")
    now = time.time()
    os.utime(folder, (now - age_s, now - age_s))
    return folder


def test_a_cache_not_used_for_a_month_is_removed_but_nothing_that_may_be_another_s_nor_links(tmp_path, monkeypatch):
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
    elsewhere, root = make_cache(tmp_path / "elsewhere", OLD), tmp_path / "root"
    root.mkdir()
    (root / "0123456789abcde1").symlink_to(elsewhere)
    (root / "0123456789abcde2").write_text("a file")
    for path in root.iterdir():
        os.utime(path, (0, 0), follow_symlinks=False)
    remove_unused(root.iterdir(), is_cache)
    make_cache(root / "0123456789abcde3", OLD)
    monkeypatch.setattr(cache_folder, "USER", os.getuid() + 1)
    remove_unused(root.iterdir(), is_cache)
    assert len(list(root.iterdir())) == 3
    assert elsewhere.exists()


ADD_ONE = """
import sys
from epuck_sim.util.native import compile_cached
def plus_one(value):
    return value + 1
compiled = compile_cached(plus_one, "0123456789abcdef", careful=False)
print(compiled(1), sum(compiled.stats.cache_hits.values()))
"""


def test_a_cache_in_use_is_marked_so_and_old_ones_go_when_a_new_one_is_made(tmp_path, monkeypatch, capsys) -> None:
    program = tmp_path / "program.py"
    program.write_text(ADD_ONE)
    cache = tmp_path / "cache"
    old, used = make_cache(cache / ("0" * 16), OLD), cache / "0123456789abcdef"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(PACKAGE.parent)}
    options = {"env": environment, "stdout": subprocess.PIPE, "text": True}
    both = [subprocess.Popen([sys.executable, program], **options) for _ in range(2)]  # at once make it
    assert [process.communicate(timeout=120)[0][:2] for process in both] == ["2 "] * 2
    assert not old.exists()
    old = make_cache(cache / ("0" * 16), OLD)
    os.utime(used, (0, 0))
    monkeypatch.setattr(jit, "cache_root", lambda **_: cache)
    runpy.run_path(str(program))
    assert capsys.readouterr().out == "2 1\n"
    assert time.time() - used.stat().st_mtime < 100
    assert old.exists()  # nothing was compiled: there was no need to look


def compile_into(folder: Path, monkeypatch) -> Any:
    """Return a function that is compiled, or was, into a cache."""

    def plus_two(value: int) -> int:
        return value + 2

    monkeypatch.setattr(jit, "cache_root", lambda **_: folder)
    return native.compile_cached(plus_two, "0123456789abcdef", careful=False)


def test_a_cache_that_is_removed_in_use_is_made_anew_and_a_full_one_costs_a_warning(tmp_path, monkeypatch) -> None:
    plus_two = compile_into(tmp_path, monkeypatch)
    assert plus_two(1) == 3
    os.utime(tmp_path / "0123456789abcdef", (0, 0))
    remove_unused(tmp_path.iterdir(), is_cache)
    assert list(tmp_path.iterdir()) == []
    assert plus_two(1.0) == 3.0
    assert list(tmp_path.rglob("*.nbc")) != []
    full = Mock(side_effect=OSError(errno.EDQUOT, "Disk quota exceeded"))
    plus_two = compile_into(tmp_path / "full", monkeypatch)
    monkeypatch.setattr("pathlib.Path.replace", full)
    with pytest.warns(UserWarning, match=rf"{tmp_path}/full: compiled code cannot be kept here.*: Disk quota exceeded"):
        assert plus_two(1) == 3


def test_files_of_the_cache_that_were_damaged_are_compiled_anew_and_healed(tmp_path, monkeypatch) -> None:
    def is_from_cache() -> bool:
        plus_two = compile_into(tmp_path, monkeypatch)
        assert plus_two(1) == 3
        return sum(plus_two.stats.cache_hits.values()) == 1

    assert [is_from_cache(), is_from_cache()] == [False, True]
    (file,) = tmp_path.rglob("*.nbc")
    contents, generator = file.read_bytes(), random.Random(4)
    for place in (generator.randrange(len(contents)) for _ in range(4)):
        flipped = contents[:place] + bytes([contents[place] ^ 4]) + contents[place + 1 :]
        for damaged in (contents[:place], flipped, b""):
            file.write_bytes(damaged)
            assert [is_from_cache(), is_from_cache()] == [False, True]


def test_what_is_unlikely_happens_all_the_same_and_arrays_of_a_block_are_passed_as_one_pointer() -> None:
    @njit
    def which(number: float) -> str:
        return "unlikely" if unlikely(number > 1) else "likely"

    assert [which(number) for number in (0.0, 2.0)] == ["likely", "unlikely"]
    count = njit(**WITHOUT_WRAPPERS)(lambda swarm: len(swarm.robots))
    assert njit(lambda block: count(carve(block, Swarm)))(make_block({"robots": 3})) == 3
    ((kind,),) = count.signatures
    assert count.targetctx.get_value_type(kind).is_pointer


def test_users_functions_multiply_matrices_though_scipy_s_are_loaded_then_alone() -> None:
    script = """if True:
        import sys, numpy, numba, epuck_sim.util.native
        assert "scipy.linalg" not in sys.modules
        print(numba.njit(lambda a: numpy.dot(a, a))(numpy.array([[1.0, 2.0], [3.0, 4.0]])).tolist())"""
    assert subprocess.check_output([sys.executable, "-c", script], text=True) == "[[7.0, 10.0], [15.0, 22.0]]\n"


def test_another_numba_or_one_told_to_compile_nothing_is_refused_in_a_sentence(tmp_path) -> None:
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{PACKAGE.parent}"}
    for other, said in (
        ("import numba.core.caching as lacking; del lacking.NullCache", "cannot import name 'NullCache'"),
        ("import numba.core.compiler as lacking; del lacking.CompileResult._rebuild", "has no attribute '_rebuild'"),
        ("import sys; sys.modules['numba'] = None", "import of numba halted"),
    ):
        (tmp_path / "sitecustomize.py").write_text(other)
        command = [sys.executable, "-m", "epuck_sim", "run", "pair"]
        found = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (found.returncode, found.stderr.count("\n")) == (2, 1), found.stderr
        assert found.stderr.startswith("error: numba 0.")
        assert said in found.stderr
        assert "install a numba that epuck-sim asks for, >=0.65 and <0.70" in found.stderr
        command += ["--out", str(tmp_path / str(len(said)))]
        found = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (found.returncode, "Traceback" in found.stderr) == (1, False), found.stderr
        assert said in found.stdout
    command, environment = command[:4], os.environ | {"NUMBA_DISABLE_JIT": "1"}
    for words in (["pair"], ["pair", "--interpret"], ["particles"], ["pair", "--out", str(tmp_path / "run")]):
        found = subprocess.run([*command, *words], env=environment, capture_output=True, text=True, check=False)
        assert (found.returncode, found.stderr.count("\n")) == (2, 1), found.stderr
        assert found.stderr.startswith("error: NUMBA_DISABLE_JIT is set")
    assert not (tmp_path / "run").exists()


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Have no cache folder that can be written to, and an empty folder for temporary files."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/dev/null/cache")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(warnings, "warn", lambda *_, **__: None)
    cache_root.cache_clear()
    yield tmp_path
    cache_root.cache_clear()


def test_without_a_cache_folder_or_a_home_there_is_one_among_temporary_files(temporary: Path, monkeypatch) -> None:
    for _ in range(2):
        folder = cache_root()
        assert folder == temporary / f"epuck-sim-{USER}"
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        cache_root.cache_clear()

    homeless = Mock(side_effect=RuntimeError("could not determine the home directory"))
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    for name in ("user_cache_path", "user_state_path"):
        monkeypatch.setattr(platformdirs, name, homeless)
    assert cache_root() == temporary / f"epuck-sim-{USER}"
    (temporary / "code.py").write_text("homeless = True\n")
    assert not is_trusted(temporary)
    trust(temporary)
    assert is_trusted(temporary)


@pytest.mark.parametrize("kind", ["open to all", "link", "of another user"])
def test_a_folder_that_others_can_write_to_is_not_taken(temporary: Path, kind: str, monkeypatch) -> None:
    name = temporary / f"epuck-sim-{USER}"
    if kind == "link":
        (temporary / "theirs").mkdir()
        name.symlink_to(temporary / "theirs")
    else:
        name.mkdir()
        name.chmod(0o777 if kind == "open to all" else 0o700)
    if kind == "of another user":
        monkeypatch.setattr(cache_folder, "USER", USER + 1)
        name.rename(temporary / f"epuck-sim-{USER + 1}")
    said: list[str] = []
    monkeypatch.setattr(warnings, "warn", lambda message, **_: said.append(message))
    fleeting_root.cache_clear()
    folder = cache_root()
    assert cache_root(to_fill=True) == folder
    assert len(said) == 1
    assert said[0].endswith(
        "nothing compiled is kept, every command compiles it anew; name a folder of your own in NUMBA_CACHE_DIR"
    )
    assert not is_kept()  # which progress asks for
    fleeting_root.cache_clear()
    assert folder.parent == temporary
    assert folder not in (name, temporary / f"epuck-sim-{USER + 1}")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_without_users_all_files_are_ours(tmp_path: Path, monkeypatch) -> None:
    tmp_path.chmod(0o777)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(cache_folder, "USER", None)
    assert cache_folder.is_ours(Path("/"))
    assert cache_root.__wrapped__() == tmp_path


def test_a_full_folder_and_one_that_others_can_write_to_are_said_and_not_used(tmp_path, monkeypatch) -> None:
    chosen = tmp_path / "chosen"
    chosen.mkdir()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(chosen))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def root() -> Path:
        cache_root.cache_clear()
        return cache_root(to_fill=True)

    assert root() == chosen
    chosen.chmod(0o777)
    with pytest.warns(UserWarning, match="NUMBA_CACHE_DIR .*chosen: other users can write to it; compiled code is kep"):
        assert root() == tmp_path / f"epuck-sim-{USER}"
    chosen.chmod(0o755)
    with no_file_larger_than(ROOM_BYTES // 2):
        with pytest.warns(UserWarning, match="chosen: File too large; compiled code is kept in"):
            assert root() == tmp_path / f"epuck-sim-{USER}"
        assert cache_root() == chosen  # for what it holds already, nothing is written
        cache_root.cache_clear()
        chosen.chmod(0o777)
        with pytest.warns(UserWarning, match="chosen: other users can write to it") as said:
            assert cache_root() == cache_root(to_fill=True)
        assert len(said) == 1
    cache_root.cache_clear()


def sine(folder: Path, cache: Path) -> str:
    """Return the sine of 1 that the package in a folder computes in a process of its own."""
    environment = os.environ | {"PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(cache)}
    program = [sys.executable, "-c", "from epuck_sim.util.elementary import sin; print(sin(1.0).hex())"]
    return subprocess.check_output(program, env=environment, cwd=folder, text=True)


def test_code_that_comes_with_a_release_is_used_elsewhere_until_a_kernel_is_edited(tmp_path: Path) -> None:
    here, elsewhere, cache = (tmp_path / name for name in ("here", "elsewhere", "cache"))
    for folder in (here, elsewhere):
        shutil.copytree(PACKAGE, folder / "epuck_sim", ignore=shutil.ignore_patterns("__pycache__", "compiled"))
        (folder / "epuck_sim" / "compiled").mkdir()  # so that both compile for the same processors
    expected = sine(here, here / "epuck_sim" / "compiled")
    shutil.copytree(here / "epuck_sim" / "compiled", elsewhere / "epuck_sim" / "compiled", dirs_exist_ok=True)
    assert sine(elsewhere, cache) == expected
    assert not list(cache.rglob("*.nbc"))
    package = elsewhere / "epuck_sim"
    assert {folder.name for folder in (package / "compiled").iterdir()} == {kernel_digest("util", package)}
    with (package / "elementary.py").open("a") as file:
        file.write("\n# an edit\n")
    kernel_digest.cache_clear()
    assert not (package / "compiled" / kernel_digest("util", package)).exists()
