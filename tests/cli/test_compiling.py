"""Claims about what is said while a first run compiles, and when code that runs on a robot never returns."""

import re
from pathlib import Path
from threading import Event

from epuck_sim.cli import progress
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.util import jit, native


def test_code_that_is_found_at_the_same_step_of_a_robot_again_is_named_once_a_trial(monkeypatch, capsys) -> None:
    monkeypatch.setattr(progress, "AT_WORK_S", 0.001)

    def said_of(steps: list[tuple[int, int, str] | None]) -> str:
        """Return what is said of code whose steps these are, at one look after the other."""
        looked, left = Event(), iter(steps)
        with progress.TrialProgress(1, load_scenario("pair").stop) as shown:
            shown.begin(0, lambda: next(left, None) or looked.set())
            assert looked.wait(10)
        return capsys.readouterr().err

    same = (4, 7, "sensor eye")
    named = "robot 4, step 7: its sensor eye has not returned for 0.001 s; Ctrl-C, given twice, ends it\n"
    assert said_of([same] * 4) == named
    assert said_of([same, (4, 8, "sensor eye"), (5, 8, "sensor eye"), (5, 8, "controller")]) == ""


def test_what_is_compiled_is_counted_with_all_that_it_calls_and_said_while_it_is(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.setattr(jit, "cache_root", lambda **_: tmp_path)
    monkeypatch.setattr(progress, "COMPILING_IN_A_LOG_S", 0.001)
    done, planned = native.count_compiled()

    global leaf  # noqa: PLW0603 kernels find each other among global names

    @jit.jit_inline
    def leaf(number):
        return number + 1

    @jit.jit_no_alloc
    def root(number):
        return leaf(number) + leaf(number + 1)

    assert native.count_compiled() == (done, planned)
    for times_said in (1, 0):  # the second time it is compiled
        with progress.TrialProgress(1, load_scenario("pair").stop):
            assert root(1) == 5
        said = re.findall(r"compiling (\d+) of (\d+) functions so far, now test_compiling.py", capsys.readouterr().err)
        assert len(said) == times_said
        assert all(done <= int(compiled) < int(of) <= planned + 2 for compiled, of in said)
        assert native.count_compiled() == (done + 2, planned + 2)
