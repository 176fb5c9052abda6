"""Files that earlier versions wrote open for ever, and hold what they held then (see old/make.py)."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import epuck_sim
from epuck_sim import StoreError, load_scenario, read_points, run_sweep
from epuck_sim.runs.compatibility import merge_folders
from epuck_sim.runs.reader import read_status
from tests.cli.commands import call, called
from tests.old.make import FILM, HERE, READERS, RUN, SHARES, run_values, values
from tests.sweep.pool_here import pool_here

VERSIONS = sorted({path.parent.name for path in HERE.glob("*/values.json")} - {epuck_sim.__version__})
pytestmark = pytest.mark.usefixtures("sweeps_run_here")


@pytest.fixture(params=VERSIONS)
def old(request, tmp_path: Path) -> Path:
    return shutil.copytree(HERE / request.param, tmp_path / request.param)


def held_then(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "values.json").read_text())


def stored(folder: Path) -> dict[tuple[str, int], tuple[float, bool]]:
    """Return how each trial of a run folder ended, by its point and seed."""
    return {
        (point.key, seed): (cycles, observed)
        for point in read_points(folder)
        for seed, cycles, observed in zip(point.seeds, point.times.tolist(), point.observed.tolist(), strict=True)
    }


def test_there_are_files_of_every_kind(old: Path) -> None:
    assert "0.1.0" in VERSIONS
    assert {path.name for path in old.iterdir()} == {*READERS, "values.json"}
    assert held_then(old).keys() == READERS.keys()


@pytest.mark.parametrize("name", [name for name in READERS if name != FILM])
def test_a_file_holds_what_it_held(old: Path, name: str) -> None:
    found, then = values(old, name), held_then(old)[name]
    for each in (found, then):  # numpy's arctan2, by which headings are read, differs among processors
        each.get("digests", {}).pop("headings", None)
    assert found == then


def test_a_film_shows_what_it_showed(old: Path) -> None:
    """Decoders may differ by a level of brightness."""
    found, then = values(old, FILM), held_then(old)[FILM]
    assert found["description"] == then["description"]
    assert found["frames"] == then["frames"]
    assert found["colours"] == pytest.approx(then["colours"], abs=0.2)
    del then["tracked"]["t_sync_cycles"]  # of the histogram then
    names_now = {  # of what version 0.1.0 found in a film
        "t_sync_s": "histogram_s",
        "t_sync_periods": "histogram_periods",
        "t_sync_onsets_s": "t_sync_s",
        "t_sync_onsets_periods": "t_sync_periods",
    }
    for name, value in then["tracked"].items():
        now = found["tracked"][names_now.get(name, name) if old.name == "0.1.0" else name]
        assert now == (pytest.approx(value, rel=0.02) if isinstance(value, float) else value), name


def test_a_finished_run_folder_stays_so_until_it_takes_further_trials_and_says_which_versions_made_them(old) -> None:
    held = run_values(old / RUN)
    progress = run_sweep(load_scenario(old / RUN), old / RUN, pool_here)
    assert (progress.ended, progress.stored) == (0, 6)
    assert run_values(old / RUN) == held
    before = stored(old / RUN)
    result = call("run", old / RUN, "--set", "trials=4")
    assert result.exit_code == 0, result.stderr
    assert f"6 trials were made by epuck_sim {old.name}" in " ".join(result.stderr.split())
    after = stored(old / RUN)
    assert len(after) == len(before) + 2
    assert after.items() >= before.items()
    made = {row.made_by["epuck_sim"]: row.trials for row in read_status(old / RUN).versions}
    assert made == {old.name: 6, epuck_sim.__version__: 2}
    assert called("summarize", old / RUN, "--json")
    called("export", old / RUN, "--to", old / "table.csv")
    assert len((old / "table.csv").read_text().splitlines()) == 1 + len(after)


def test_shares_are_merged_but_not_those_of_two_versions_and_both_are_named(old: Path) -> None:
    first, second = (old / name for name in SHARES)
    merge_folders([first, second], old / "whole")
    assert stored(old / "whole") == stored(first) | stored(second)
    assert len(stored(old / "whole")) == 10
    run_sweep(load_scenario(first, ["trials=7"]), first, pool_here)
    ours = epuck_sim.__version__.replace(".", r"\.")
    with pytest.raises(StoreError, match=rf"epuck_sim {ours}.*epuck_sim {old.name}|epuck_sim {old.name}.*{ours}"):
        merge_folders([first, second], old / "other")
    assert not (old / "other").exists()
