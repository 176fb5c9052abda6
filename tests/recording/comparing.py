"""Comparison of recordings by rerun's own program."""

from pathlib import Path

from epuck_sim.recording.process import run_rerun
from epuck_sim.recording.rrd_file import SEAL


def compare(one: Path, other: Path) -> None:
    """Raise RecordingError if two recordings differ, but for the digests of their files: rerun numbers each anew."""
    unsealed = [path.with_suffix(".unsealed.rrd") for path in (one, other)]
    for path, left in zip((one, other), unsealed, strict=True):
        run_rerun("rrd", "filter", "--drop-entity", SEAL, str(path), "-o", str(left))
    run_rerun("rrd", "compare", *map(str, unsealed))
