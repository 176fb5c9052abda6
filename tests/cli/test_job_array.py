"""The job array of the docs, with stand-ins for what SLURM brings: shares run, end in time and are queued again."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from epuck_sim.runs.folder import DATABASE
from epuck_sim.runs.reader import read_status
from tests.processes import wait_until
from tests.sweep.short_sweeps import short_sweep, stored

PAGE = Path(__file__).parents[2] / "docs" / "clusters.md"


def start(folder: Path, scenario: Path, number: int, of: int) -> subprocess.Popen:
    """Start the script as SLURM would start job `number` of an array of `of`, for a scenario of ours."""
    (script,) = [
        block for block in re.findall(r"^```bash\n(.*?)^```", PAGE.read_text(), re.M | re.S) if "#SBATCH" in block
    ]
    (folder / "array.sh").write_text(script.replace("fig-4-2a", str(scenario)).replace("/40", f"/{of}"))
    tools = {"epuck-sim": f'exec {sys.executable} -m epuck_sim "$@"', "scontrol": f'echo "$@" >> {folder}/requeued'}
    (folder / "bin").mkdir(exist_ok=True)
    for name, line in tools.items():
        (folder / "bin" / name).write_text(f"#!/bin/sh\n{line}\n")
        (folder / "bin" / name).chmod(0o755)
    given = {"SLURM_ARRAY_TASK_ID": str(number), "SLURM_ARRAY_JOB_ID": "77", "SLURM_CPUS_PER_TASK": "1"}
    path = {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "SLURM_TMPDIR": str(folder / "node")}
    return subprocess.Popen(["bash", "array.sh"], cwd=folder, env={**os.environ, **given, **path})


def test_a_job_whose_time_is_nearly_up_is_queued_again_and_goes_on_to_the_end_of_its_share(tmp_path) -> None:
    scenario, local = short_sweep(tmp_path, 60), tmp_path / "node" / "share-77-2"
    job = start(tmp_path, scenario, 2, 3)
    wait_until(lambda: stored(local) > 0, 300)
    job.send_signal(signal.SIGUSR1)
    assert job.wait(300) == 0
    assert (tmp_path / "requeued").read_text() == "requeue 77_2\n"
    kept = tmp_path / "runs/shares/2"
    assert 0 < stored(kept) < 160
    (local / DATABASE).unlink()  # the next job may have another node
    assert start(tmp_path, scenario, 2, 3).wait(300) == 0
    status = read_status(kept)
    assert (status.share, status.stored, status.trials) == ("2/3", 160, 160)
    assert (tmp_path / "requeued").read_text() == "requeue 77_2\n"
