"""Options of `track` are parsed or refused, and its output agrees with the track."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from epuck_sim.cli import progress as progress_module
from epuck_sim.cli.films import parse_arena, parse_corners
from epuck_sim.cli.progress import progress_bar
from epuck_sim.cli.tables import print_track
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera import Frame
from tests.overhead.films import TRACK


@pytest.mark.parametrize(("text", "sides"), [("60", (60, 60)), (" 60 x 100.5 ", (60, 100.5)), ("1000000x1", (1e6, 1))])
def test_arena_is_read(text: str, sides: tuple[float, float]) -> None:
    assert parse_arena(text) == sides


def test_no_arena_is_refused() -> None:
    for text in ["", "60x", "x60", "0.5", "60x0", "-60", "60x100x20", "60,100", "nan", "1e3", "1000001", "٦٠"]:
        with pytest.raises(FilmError, match=r"^--arena-cm is .*; allowed: .*60x100"):
            parse_arena(text)


FRAMES = [Frame(number / 2, np.zeros((2, 2, 3), np.uint8)) for number in range(5)]


@settings(max_examples=20)
@given(st.lists(st.integers(0, 9999).map(lambda tenths: tenths / 10), min_size=8, max_size=8))
def test_corners_are_read(numbers: list[float]) -> None:
    corners = parse_corners(",".join(map(str, numbers)))
    assert [number for corner in corners for number in corner] == numbers
    assert [len(corner) for corner in corners] == [2] * 4


def test_no_corners_are_refused() -> None:
    for text in ["", "1,2,3,4,5,6,7", "1,2,3,4,5,6,7,8,9", "1 2 3 4 5 6 7 8", "1,2,3,4,5,6,7,x", "1,,2"]:
        with pytest.raises(FilmError, match=r"^--corners is .*; allowed: four corners in pixels"):
            parse_corners(text)


def test_t_sync_comes_first_and_the_table_fits_a_screen(monkeypatch, capsys) -> None:
    monkeypatch.setattr("epuck_sim.cli.tables.terminal_width", lambda: 80)
    doubts = ("rings are missed, or something shines; give --corners, --arena-cm", "is it 2 s? give --period-s")
    print_track(TRACK._replace(warnings=doubts, confidence="low"))
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["T_sync", "3.4", "cycles,", "2.5", "s"]
    assert "low; --corners, --arena-cm, --period-s may settle it" in lines[2]
    assert len(lines) <= 20
    assert max(map(len, lines)) <= 80


def test_a_swarm_that_never_synchronised_in_a_film_whose_name_is_no_markup(capsys: pytest.CaptureFixture[str]) -> None:
    print_track(TRACK._replace(film="[bold]swarm[/bold] [/].mp4", t_sync_s=None, histogram_s=None, estimated=()))
    text = capsys.readouterr().out
    assert "[bold]swarm[/bold] [/].mp4" in text
    assert "never" in text
    assert "by the histogram" not in text
    assert "estimated" not in text


@pytest.mark.parametrize("is_terminal", [True, False])
def test_frames_are_passed_on_as_they_come(is_terminal: bool, monkeypatch, capsys) -> None:
    def console(**options: Any) -> Console:
        return Console(**options, force_terminal=is_terminal)

    monkeypatch.setattr(progress_module, "Console", console)
    frames = iter(FRAMES)
    passed = progress_bar("tracking")(frames, 2.0)
    assert next(iter(passed)) is FRAMES[0]
    assert next(frames) is FRAMES[1]  # one at a time
    assert list(passed) == FRAMES[2:]
    shown = capsys.readouterr()
    assert shown.out == ""
    assert ("tracking" in shown.err) == ("2 s of film" in shown.err) == is_terminal
