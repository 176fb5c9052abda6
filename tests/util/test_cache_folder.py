"""Compiled code is loaded from folders of the user alone."""

import resource
import signal
import stat
import tempfile
import warnings
from pathlib import Path

import pytest

from epuck_sim.util import cache_folder, machine
from epuck_sim.util.cache_folder import ROOM_BYTES, cache_root
from epuck_sim.util.machine import USER


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Have no cache folder that can be written to, and an empty folder for temporary files."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/dev/null/cache")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(warnings, "warn", lambda *_, **__: None)
    cache_root.cache_clear()
    yield tmp_path
    cache_root.cache_clear()


def test_without_a_cache_folder_there_is_one_of_the_user_among_temporary_files(temporary: Path) -> None:
    for _ in range(2):
        folder = cache_root()
        assert folder == temporary / f"epuck-sim-{USER}"
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        cache_root.cache_clear()


@pytest.mark.parametrize("kind", ["open to all", "link", "of another user"])
def test_a_folder_that_others_can_write_to_is_not_taken(
    temporary: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = temporary / f"epuck-sim-{USER}"
    if kind == "link":
        (temporary / "theirs").mkdir()
        name.symlink_to(temporary / "theirs")
    else:
        name.mkdir()
        name.chmod(0o777 if kind == "open to all" else 0o700)
    if kind == "of another user":
        monkeypatch.setattr(cache_folder, "USER", USER + 1)
        monkeypatch.setattr(machine, "USER", USER + 1)
        name.rename(temporary / f"epuck-sim-{USER + 1}")
    folder = cache_root()
    assert folder.parent == temporary
    assert folder not in (name, temporary / f"epuck-sim-{USER + 1}")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


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
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM_BYTES // 2, before[1]))
    try:
        with pytest.warns(UserWarning, match="chosen: File too large; compiled code is kept in"):
            assert root() == tmp_path / f"epuck-sim-{USER}"
        assert cache_root() == chosen  # for what it holds already, nothing is written
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
        cache_root.cache_clear()
