"""Tables of who is who in a film: flashes, a trace, and pairs."""

import csv
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from epuck_sim.order_parameter import order_parameter
from epuck_sim.overhead.flashes import Flash, FlashLinker, FlashTable
from epuck_sim.overhead.identities import Identities
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.robots import (
    Robots,
    find_robots,
    flash_columns,
    order_of_shares,
    pair_columns,
    phase_shares,
    save_robots,
    summary,
    trace_columns,
    write_table,
)
from epuck_sim.overhead.track import Track
from tests.overhead.films import TRACK, even

CYCLES = 6
HOMES = np.array([(10.0, 10.0), (45.0, 15.0), (30.0, 45.0)])


def track_of(phases_s: list[float], cycles: int = CYCLES) -> Track:
    """Return what is found in a film of robots that drive at 0.5 cm/s and flash at phases of a period of 1 s."""
    flashes = [
        Flash(k + phase, k + phase + 0.1, home[0] + 0.5 * k, home[1], 80.0, 0.5, 0.0)
        for k in range(cycles)
        for phase, home in zip(phases_s, HOMES, strict=True)
    ]
    return TRACK._replace(flashes=tuple(sorted(flashes)), times_s=even(cycles, 20), start_s=0.0)


def test_flashes_have_their_velocity() -> None:
    linker = FlashLinker()
    for number in range(8):
        rings = [Ring(10 + 0.4 * number, 20 - 0.2 * number, 3.5, 0, 0, 5, 90)] if number < 5 else []
        linker.add(number / 10, rings)
    (flash,) = linker.flashes
    assert flash == pytest.approx((0.0, 0.5, 10.8, 19.6, 90.0, 4.0, -2.0))
    linker = FlashLinker()
    linker.add(0.0, [Ring(10, 20, 3.5, 0, 0, 5, 90)])
    assert linker.flashes[0][5:] == (0, 0)


def test_a_trace_tells_what_is_seen_and_leaves_out_what_is_not() -> None:
    track = track_of([0.1, 0.4, 0.7])
    table = trace_columns(track, find_robots(track))
    assert list(table) == ["time_s", "robot", "x_cm", "y_cm", "heading_rad", "ring_on", "phase_ms"]
    assert len({len(column) for column in table.values()}) == 1
    own = {name: column[table["robot"] == 1] for name, column in table.items()}
    assert len(own["time_s"]) == len(track.times_s)
    assert own["ring_on"].sum() == 2 * CYCLES
    assert (np.isnan(own["x_cm"]) == ~own["ring_on"]).all()
    assert np.isnan(own["heading_rad"]).all()
    assert own["y_cm"][own["ring_on"]] == pytest.approx(15)
    first, second = own["x_cm"][own["ring_on"]][:2]
    assert second - first == pytest.approx(0.5 * 0.05)
    at = own["time_s"] >= 0.4 - 1e-9
    assert np.isnan(own["phase_ms"][~at]).all()
    # the threshold of a period of 1 s: from one flash to the next in 1000 ms
    assert own["phase_ms"][at] == pytest.approx(1000 * ((own["time_s"][at] - 0.4 + 1e-9) % 1), abs=1e-3)


def test_a_ring_that_is_lit_at_the_end_of_the_film_is_lit_in_its_last_frame() -> None:
    track = track_of([0.1, 0.4, 0.7])
    last_s = float(track.times_s[-1])
    late = Flash(last_s, last_s, 30.0, 45.0, 80.0)
    flashes = (*(flash for flash in track.flashes if flash.onset_s < last_s - 0.5), late)
    track = track._replace(flashes=flashes)
    table = trace_columns(track, find_robots(track))
    is_last = table["time_s"] == last_s
    assert table["ring_on"][is_last].sum() == 1
    assert table["y_cm"][is_last & table["ring_on"]] == pytest.approx(45)


def test_flashes_tell_whose_they_are_and_the_order_of_phases() -> None:
    track = track_of([0.5, 0.5, 0.52])
    robots = find_robots(track)
    table = flash_columns(track, robots)
    assert table["robot"].tolist()[:3] == [0, 1, 2]
    assert np.isnan(table["order_parameter"]).tolist() == [False] * 15 + [True] * 3  # the film ends before its period
    assert sorted(table["cycle"].tolist()) == sorted([*range(1, CYCLES + 1)] * 3)
    assert np.isnan(table["certainty"]).sum() == 3
    assert np.nanmin(table["certainty"]) > 0.95
    assert table["phase_order_parameter"][-1] == pytest.approx(np.abs(np.exp(2j * np.pi * 0.02) + 2) / 3, abs=1e-6)
    found = summary(track, robots)
    assert (found["by"], found["robots"], found["links"], found["unsure_share"]) == ("motion", [0, 1, 2], 15, 0)
    assert found["by_phases_s"] == pytest.approx(0.52)
    assert found["pairs_together"] == 3
    assert pair_columns(track, robots)["share"].tolist() == [1, 1, 1]


def test_what_is_doubtful_is_said() -> None:
    track = track_of([0.1, 0.4, 0.7])
    told = track._replace(options=track.options._replace(robots=4))
    assert find_robots(track).warnings == ()
    (warning,) = find_robots(told).warnings
    assert warning == "flashes are linked to 3 robots, but there are 4: some were lost and count anew"
    together = enumerate(track_of([0.1] * 3).flashes)
    close = tuple(flash._replace(x_cm=20.0 + 0.1 * (index % 3), y_cm=20.0) for index, flash in together)
    (warning,) = find_robots(track._replace(flashes=close)).warnings
    assert " % of the links from flash to flash have an alternative that is nearly as good" in warning


def test_tables_are_written_as_csv_and_as_parquet_alike(tmp_path: Path) -> None:
    track = track_of([0.1, 0.4, 0.7])
    robots = find_robots(track)
    save_robots(track, robots, tmp_path / "f.csv", tmp_path / "t.parquet", tmp_path / "p.csv")
    save_robots(track, robots, tmp_path / "f.parquet", tmp_path / "t.csv", None)
    for name, expected in (("f", flash_columns(track, robots)), ("t", trace_columns(track, robots))):
        table = pq.read_table(tmp_path / f"{name}.parquet")
        with (tmp_path / f"{name}.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert table.column_names == list(rows[0]) == list(expected)
        for column, values in expected.items():
            kept = np.array([np.nan if value is None else value for value in table[column].to_pylist()], float)
            assert kept == pytest.approx(values.astype(float), nan_ok=True)
            words = [{"": "nan", "True": "1", "False": "0"}.get(row[column], row[column]) for row in rows]
            assert np.array(words, float) == pytest.approx(values.astype(float), nan_ok=True, rel=1e-5, abs=1e-6)
    assert table.schema.metadata[b"film"] == b"film.mp4"


def test_a_film_without_flashes_gives_tables_without_rows(tmp_path: Path) -> None:
    track = TRACK._replace(flashes=())
    robots = find_robots(track)
    assert isinstance(robots, Robots)
    for ending in ("csv", "parquet"):
        for name, columns in (("f", flash_columns), ("t", trace_columns), ("p", pair_columns)):
            write_table(tmp_path / f"{name}.{ending}", columns(track, robots), {})
    assert (tmp_path / "t.csv").read_text() == "time_s,robot,x_cm,y_cm,heading_rad,ring_on,phase_ms\n"
    assert summary(track, robots)["by_phases_s"] is None


ONSETS = np.array([0.0, 0.5, 1.0, 1.4, 2.0, 2.4, 4.0])
ROBOT = np.array([0, 1, 0, 1, 0, 1, 0])


def test_phases_rise_from_flash_to_flash() -> None:
    times = np.array([0.0, 0.25, 0.5, 0.95, 2.2, 2.5, 3.0, 4.5, 5.5])
    shares = phase_shares(ONSETS, ROBOT, np.array([0, 1, 2]), times, 1.0)
    assert np.isnan(shares[:, 2]).all()  # it never flashes
    nan = np.nan
    # robot 0 was not seen for two periods from 2.0 on; robot 1 flashed early, and last at 2.4
    assert shares[:, 0] == pytest.approx([0, 0.25, 0.5, 0.95, nan, nan, nan, 0.5, nan], nan_ok=True)
    assert shares[:, 1] == pytest.approx([nan, nan, 0, 0.5, 0.8, 0.1, 0.6, nan, nan], nan_ok=True)


def test_the_order_parameter_is_that_of_the_phases() -> None:
    shares = np.array([[0.1, 0.2, 0.3, 0.9], [0.5, 0.5, 0.5, np.nan], [0.5, 0.5, np.nan, np.nan]])
    order = order_of_shares(shares)
    assert order[0] == pytest.approx(float(order_parameter(shares[0], 1.0)))
    assert order[1] == pytest.approx(1)  # three of four are enough
    assert np.isnan(order[2])


def test_pairs_are_those_whose_flashes_overlap() -> None:
    onsets = np.array([0.0, 0.05, 0.5, 1.0, 1.2, 1.5, 2.0, 2.05])
    flashes = FlashTable.of([Flash(onset, onset + 0.1, 0.0, 0.0, 9.0) for onset in onsets])
    whose = np.array([0, 1, 2, 0, 1, 2, 0, 1])
    numbers = np.array([0, 1, 2, 3])
    robots = Robots("tags", flashes, Identities(whose, whose, onsets, 1.0), numbers, None, ())
    table = pair_columns(TRACK, robots)
    pairs = list(zip(table["robot"].tolist(), table["other"].tolist(), strict=True))
    assert pairs == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    assert (table["flashes"][0], table["together"].tolist()) == (3, [2, 0, 0, 0, 0, 0])
    assert table["share"][0] == pytest.approx(2 / 3)
