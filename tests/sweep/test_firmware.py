"""Firmware that crashes, or never returns, costs a sweep its own trial alone; an edit of it is noticed."""

import pytest

from epuck_sim.sweep.worker import LIMIT_VARIABLE
from tests.sweep.short_sweeps import begin, errors, stored

FATE = """
#define PARAMETERS E_INT(fatal)
#define MEMORY E_INT(fate) E_INT(steps)
#include <epuck.h>

void start(void) {{ memory->fate = e_random_word() % 3; {start} }}

void step(void) {{
    memory->steps++;
    if (parameters->fatal && memory->fate == 0 && memory->steps > 3) {{
        {fatal}
    }}
}}
"""

CRASH, LOOP = "*(volatile int *)parameters->fatal = 1;", "while (memory->fate == 0) *e_swarm->serving += 0;"


def write_sweep(folder, fatal, start=""):
    (folder / "fate.c").write_text(FATE.format(fatal=fatal, start=start))
    path = folder / "sweep.yaml"
    path.write_text(
        "robots: [{count: 1, controller: fate.c}]\nstop: {max_time_s: 1}\ntrials: 8\n"
        "sweep: {grid: {robots.0.parameters.fatal: [0, 1]}}\n"
    )
    return path


@pytest.mark.parametrize("fatal", [CRASH, LOOP], ids=["crash", "endless loop"])
def test_firmware_that_crashes_or_never_returns_costs_its_own_trial_alone(tmp_path, monkeypatch, fatal) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "0.5")
    folder = tmp_path / "run"
    run = begin(write_sweep(tmp_path, fatal), "--out", folder, "--workers", 2, folder=tmp_path)
    _, err = run.communicate(timeout=280)
    assert run.returncode == 1, err
    assert stored(folder) == 16
    failed = errors(folder)
    assert 0 < len(failed) < 8
    assert all("its worker died" in message for message in failed.values())
    if fatal == LOOP:
        assert "robot 0, step 3: its controller has not returned for 0.5 s; its worker is ended\n" in err


def test_a_run_folder_refuses_firmware_that_has_changed(tmp_path) -> None:
    path, folder = write_sweep(tmp_path, "memory->fate = 1;"), tmp_path / "run"
    assert begin(path, "--out", folder, "--workers", 1, folder=tmp_path).wait(120) == 0
    write_sweep(tmp_path, "memory->fate = 2;")
    run = begin(path, "--out", folder, folder=tmp_path)
    _, err = run.communicate(timeout=120)
    assert run.returncode == 2
    assert "robots.0.controller: 'fate.c with digest " in err
