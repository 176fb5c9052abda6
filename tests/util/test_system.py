"""What not every system has is missed by nothing but what needs it: trials, sweeps and summaries work without."""

import os
import subprocess
import sys
from pathlib import Path

from epuck_sim.util import system
from epuck_sim.util.system import is_open_to_others, is_ours, signals

ROOT = Path(__file__).parents[2]

ELSEWHERE = """
import platformdirs.unix, psutil  # which have files of their own for each system
import multiprocessing, os, signal, sys

sys.modules.update(fcntl=None, resource=None, termios=None)
for module, names in {os: ("getuid", "geteuid", "fork"), signal: ("SIGHUP", "pthread_sigmask", "pthread_kill")}.items():
    for name in names:
        delattr(module, name)
multiprocessing.get_all_start_methods = lambda: ["spawn"]
"""
"""Takes away, from every process that is started, what Windows does not have."""


def test_a_trial_a_sweep_and_a_summary_need_nothing_that_windows_lacks(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(ELSEWHERE)
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}

    def command(*arguments: str) -> subprocess.CompletedProcess[str]:
        program = [sys.executable, "-m", "epuck_sim", *arguments]
        done = subprocess.run(program, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done

    missing = "import fcntl"
    assert subprocess.run([sys.executable, "-c", missing], env=environment, check=False, capture_output=True).returncode
    assert "T_sync" in command("run", "thesis", "--set", "stop.max_cycles=5").stdout
    command("run", "thesis", "--set", "stop.max_cycles=5", "--trials", "4", "--workers", "2", "--out", "o")
    assert "4" in command("summarize", "o").stdout


def test_without_users_all_files_are_ours(tmp_path: Path, monkeypatch) -> None:
    tmp_path.chmod(0o777)
    assert is_open_to_others(tmp_path)
    assert is_ours(tmp_path)
    monkeypatch.setattr(system, "USER", None)
    assert is_ours(Path("/"))
    assert not is_open_to_others(tmp_path)


def test_a_signal_that_is_not_there_is_left_out() -> None:
    assert [each.name for each in signals("SIGINT", "SIGNOTHING", "SIGTERM")] == ["SIGINT", "SIGTERM"]
