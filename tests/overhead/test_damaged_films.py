"""A damaged film is refused in words, or read with times that increase; never a traceback."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from epuck_sim.errors import FilmError
from epuck_sim.overhead.film import open_film
from tests.overhead.small_films import AVI, MKV, MP4, TS, Kind, number_in, write_film

KINDS = (MP4, MKV, AVI, TS)
FRAMES = 20
SEARCH = settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
FLIPS = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=3)


@pytest.fixture(scope="module", params=KINDS, ids=lambda kind: f"{kind.ending}-{kind.codec}")
def kind(request) -> Kind:
    return request.param


@pytest.fixture(scope="module")
def film(kind: Kind, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("film") / f"f.{kind.ending}"
    return write_film(path, [ticks_between(kind) * number for number in range(FRAMES)], kind)


def ticks_between(kind: Kind) -> int:
    return max(1, round(1 / (15 * kind.tick_s)))


def read(path: Path) -> list[tuple[float, int]]:
    """Return the times and numbers of a film's pictures; none if it is refused."""
    try:
        with open_film(str(path)) as opened:
            return [(frame.time_s, number_in(frame.picture)) for frame in opened.frames()]
    except FilmError as error:
        message = str(error)
    assert message.startswith(f"{path}: ")
    return []


@SEARCH
@given(flips=FLIPS, share=st.floats(0, 1, exclude_max=True))
def test_a_film_that_is_changed_or_cut_off_ends_in_no_traceback(film: Path, kind: Kind, tmp_path, flips, share) -> None:
    whole, path = film.read_bytes(), tmp_path / f"f.{kind.ending}"
    damaged = bytearray(whole)
    for place, change in flips:
        damaged[int(place * len(damaged))] ^= change
    path.write_bytes(damaged)
    times = [time_s for time_s, _ in read(path)]
    assert times == sorted(set(times))

    path.write_bytes(whole[: int(share * len(whole))])
    interval_s = float(ticks_between(kind) * kind.tick_s)
    for time_s, number in read(path)[:-1]:  # the last one may be half a picture
        assert number == round(time_s / interval_s)
