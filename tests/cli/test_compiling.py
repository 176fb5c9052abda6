"""Claims about what is said while a first run compiles."""

import os
import re
import subprocess
import sys
from pathlib import Path

from epuck_sim.util import jit, native


def test_a_first_run_says_how_much_is_compiled_and_the_next_says_nothing(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "epuck_sim", "run", "pair", "--json"]
    first, second = (
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=300)
        for _ in range(2)
    )
    done, planned = map(int, re.findall(r"compiling (\d+) of (\d+) functions", first.stderr)[0])
    assert first.stderr.count("compiling") == 1
    assert 0 <= done < planned
    assert "compiling" not in second.stderr
    assert first.stdout.partition("wall_s")[0] == second.stdout.partition("wall_s")[0]


def test_what_is_compiled_is_counted_with_all_that_it_calls(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(jit, "cache_root", lambda **_: tmp_path)
    done, planned = native.count_compiled()

    global leaf  # noqa: PLW0603 kernels find each other among global names

    @jit.jit_inline
    def leaf(number):
        return number + 1

    @jit.jit_no_alloc
    def root(number):
        return leaf(number) + leaf(number + 1)

    assert native.count_compiled() == (done, planned)
    assert root(1) == 5
    assert native.count_compiled() == (done + 2, planned + 2)
