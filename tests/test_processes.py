"""Processes that tests start hear Ctrl-C and do not outlive their test."""

import signal
import sys

from tests.processes import end_all, processes_marked, start, wait_until

FAMILY = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
print("started", flush=True)
time.sleep(600)
"""


def test_ctrl_c_is_heard_even_where_these_tests_ignore_it() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process = start([sys.executable, "-c", "import time; print('started', flush=True); time.sleep(600)"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert process.stdout.readline() == "started\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in errors


def test_all_descendants_are_ended_even_if_the_first_process_has_ended(tmp_path) -> None:
    process = start([sys.executable, "-c", FAMILY], mark=str(tmp_path))
    assert process.stdout.readline() == "started\n"
    wait_until(lambda: len(processes_marked(str(tmp_path))) == 2)  # a child shows its mark once it is on its way
    process.kill()
    process.wait()
    end_all()
    wait_until(lambda: not processes_marked(str(tmp_path)))
