"""What a viewer shows of a recording is what was recorded; viewers start, answer, fail and end as they should."""

import math
import os
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
import psutil
import pytest
from PIL import Image
from rerun.chunk import RrdReader
from scipy import ndimage

from epuck_sim import RecordingError, load_scenario, read_recording
from epuck_sim.epuck import RADIUS_CM
from epuck_sim.recording import Level, rerun, viewer
from epuck_sim.recording.rerun import NO_GRAPHICS, in_background, run_rerun
from epuck_sim.recording.viewer import draw_screenshot, has_display, serve, show, web_viewer
from epuck_sim.util.machine import free_port
from tests.processes import processes_marked, start, wait_until
from tests.recording.recordings import Found, Watched, recorded
from tests.recording.viewers import ARENA, DARK, LIT, Stand, alike, answer, discs, nothing_left, pixels, replace_rerun
from tests.tools import MAY_LACK

RED, UNLIT_PIXEL = (225, 40, 40), (30, 30, 34)  # as in `layers.robots.COLOURS`


@pytest.fixture(autouse=True)
def all_has_ended(tmp_path):
    with nothing_left(tmp_path):
        yield


@pytest.fixture(scope="module")
def thesis(tmp_path_factory) -> tuple[Path, Watched]:
    path, watched = tmp_path_factory.mktemp("thesis") / "t.rrd", Watched()
    recorded(path, load_scenario("thesis"), 3, Level.FULL, watched)
    return path, watched


@pytest.fixture(scope="module")
def moment(thesis, tmp_path_factory):
    """Return a step of the thesis arena, as it was and as it is drawn, (height, width, 3)."""
    path, watched = thesis
    read, folder = read_recording(path), tmp_path_factory.mktemp("picture")
    # a step at which some rings have been lit for a while, and all robots stand free
    positions, ring_on = read.positions.astype(float), read.ring_on
    gaps = np.linalg.norm(positions[:, :, None] - positions[:, None], axis=-1) + 100 * np.eye(ring_on.shape[1])
    beside = np.diff(np.sort(positions[..., 0], axis=1), axis=1).min(axis=1)
    free = (gaps.min(axis=(1, 2)) > 8.5) & (beside > 0.2)
    glowing = np.zeros_like(ring_on)
    glowing[2:] = ring_on[2:] & ring_on[1:-1] & ring_on[:-2]
    step = int(np.flatnonzero(free & (ring_on.sum(axis=1) > 2) & (glowing.sum(axis=1) > 1))[0])
    try:
        with nothing_left(folder), pytest.MonkeyPatch.context() as patch:
            patch.setenv("TMPDIR", str(folder))  # in which nothing is to be left, either
            patch.setattr(viewer, "MESSAGES_S", 0)  # it looks whether there are any all the same
            draw_screenshot(path, read.time_s[step], folder / "p.png")
    except RecordingError as error:
        if str(error) == NO_GRAPHICS and MAY_LACK:
            pytest.skip(NO_GRAPHICS)
        raise
    assert [file.name for file in folder.iterdir()] == ["p.png"]
    was = watched.steps[step]
    was.picture = pixels(folder / "p.png")
    return was


def test_each_robot_is_a_disc_red_if_its_ring_is_lit_where_it_was_with_y_up(moment) -> None:
    assert moment.picture.shape == (900, 1600, 3)
    arena, lit = moment.picture[ARENA], int(moment.ring_on.sum())
    assert (len(discs(arena, LIT)), len(discs(arena, DARK))) == (lit, len(moment.ring_on) - lit)
    groups = [sorted(map(tuple, moment.poses[moment.ring_on == lit, :2])) for lit in (True, False)]
    robots = np.array([robot for group in groups for robot in group])
    shown = np.concatenate([discs(arena, LIT), discs(arena, DARK)])
    (right, left), (up, bottom) = (np.polyfit(robots[:, axis], shown[:, axis], 1) for axis in (0, 1))
    np.testing.assert_allclose(shown[:, 0], left + right * robots[:, 0], rtol=0, atol=2.5)
    np.testing.assert_allclose(shown[:, 1], bottom + up * robots[:, 1], rtol=0, atol=2.5)
    assert right > 5
    assert up == pytest.approx(-right, rel=0.01)
    np.testing.assert_allclose(shown[:, 2], RADIUS_CM * right, rtol=0, atol=2.5)


def test_camera_rows_are_red_where_a_lit_ring_is_seen(moment) -> None:
    pane = moment.picture[690:868, :955]  # of 1600 x 900: columns are laid out as 3 to 2, rows as 3 to 1
    red, black = alike(pane, RED), abs(pane - UNLIT_PIXEL).max(axis=-1) < 4
    rows, columns = np.nonzero(ndimage.binary_opening(red | black, iterations=2))
    height, width = moment.camera.shape
    y = rows.min() + (np.arange(height) + 0.5) * (np.ptp(rows) + 1) / height
    x = columns.min() + (np.arange(width) + 0.5) * (np.ptp(columns) + 1) / width
    np.testing.assert_array_equal(red[np.ix_(y.astype(int), x.astype(int))], moment.camera > 0)
    assert moment.camera.any()
    corner = moment.picture[viewer.MESSAGE_ROWS, viewer.MESSAGE_COLUMNS]
    assert (corner == viewer.MESSAGE_GREY).all(axis=-1).mean() < 0.1  # no message covers the picture


@pytest.mark.parametrize("size", [(900, 1600), (300, 400)])
def test_a_picture_is_taken_once_its_message_has_gone(monkeypatch, size: tuple[int, int]) -> None:
    monkeypatch.setattr(viewer, "MESSAGES_S", 0)
    monkeypatch.setattr("time.sleep", lambda _: None)
    clear = np.full((*size, 3), 13, np.uint8)
    covered = clear.copy()
    covered[30:112, -340:-8] = viewer.MESSAGE_GREY
    taken = [BytesIO() for _ in range(5)]
    for png, picture in zip(taken, [covered] * 3 + [clear] * 2, strict=True):
        Image.fromarray(picture).save(png, "PNG")
    pictures = iter(taken)
    assert viewer._settled(lambda: next(pictures).getvalue()) == taken[-1].getvalue()
    assert next(pictures, None) is None


def test_without_a_graphics_driver_an_error_says_what_to_install(thesis, tmp_path, monkeypatch) -> None:
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES", "__EGL_VENDOR_LIBRARY_FILENAMES"):
        monkeypatch.setenv(name, "/nonexistent")
    (tmp_path / "p.png").write_text("older")
    with pytest.raises(RecordingError) as caught:
        draw_screenshot(thesis[0], 1.0, tmp_path / "p.png")
    assert str(caught.value) == NO_GRAPHICS
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"p.png": "older"}


SLEEP = "time.sleep(600)"
DEAF = ("import signal", "signal.signal(signal.SIGTERM, signal.SIG_IGN)", "open(sys.argv[1], 'w').close()", SLEEP)


@pytest.fixture
def stand(tmp_path, monkeypatch) -> Stand:
    return replace_rerun(tmp_path / "stand", monkeypatch)


def test_a_viewer_that_never_answers_or_ends_at_once_is_reported_with_its_last_words(stand: Stand, monkeypatch) -> None:
    long = "".join(f"line {line}\n" for line in range(5000)) + "and here it broke"
    port, at_end = free_port(), r"(.|\n)*line 4999\nand here it broke"
    for acts, start_s, said in ((SLEEP, 0.5, "it does not answer"), (f"sys.exit({long!r})", math.inf, at_end)):
        monkeypatch.setattr(rerun, "START_S", start_s)
        stand.acts(acts)
        with pytest.raises(RecordingError, match=f"^the viewer does not work: {said}$") as caught, web_viewer(port):
            pytest.fail("it answered")
        assert len(str(caught.value)) < 1100


def test_where_the_viewer_breaks_down_nothing_is_left_of_a_picture(stand: Stand, tmp_path) -> None:
    # what rerun says where Mesa's OpenGL is there, but no Vulkan driver
    no_renderer = "thread 'main' panicked at 'Failed to get render context'\nre_viewer/src/app/mod.rs:1425"
    at_all = "^the viewer does not work: it broke$"
    for said, message in (("it broke", at_all), (no_renderer, "apt install mesa-vulkan")):
        stand.answers_and_says(said)
        with pytest.raises(RecordingError, match=message):
            draw_screenshot(tmp_path / "t.rrd", 1.0, tmp_path / "p.png")
        assert [file.name for file in tmp_path.iterdir()] == ["stand"]


def test_no_use_is_reported_to_rerun_unless_the_user_allows_it(stand: Stand, monkeypatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.delenv("RERUN_ANALYTICS", raising=False)
    for analytics in ("0", "1"):
        for use in (lambda: show(Path("t.rrd")), lambda: run_rerun("rrd", "verify", "t.rrd")):
            use()
            assert stand.received["analytics"] == analytics
        monkeypatch.setenv("RERUN_ANALYTICS", "1")


def test_a_command_that_fails_is_reported(stand: Stand, tmp_path, monkeypatch) -> None:
    run_rerun("rrd", "verify", "t.rrd")
    stand.acts("sys.exit('is not a recording')")
    with pytest.raises(RecordingError, match=r"^rerun rrd verify failed: is not a recording$"):
        run_rerun("rrd", "verify", "t.rrd")
    monkeypatch.undo()  # the real program
    with pytest.raises(RecordingError, match=r"rerun rrd verify failed: .*gone\.rrd"):
        run_rerun("rrd", "verify", str(tmp_path / "gone.rrd"))


def test_a_display_is_known_by_its_name_and_without_one_the_error_names_the_other_ways(monkeypatch) -> None:
    for system in ("darwin", "win32"):
        monkeypatch.setattr(sys, "platform", system)
        assert has_display()
    monkeypatch.setattr(sys, "platform", "linux")
    for given in ("DISPLAY", "WAYLAND_DISPLAY"):
        for name in ("DISPLAY", "WAYLAND_DISPLAY"):
            monkeypatch.setenv(name, ":0" if name == given else "")
        assert has_display()
        monkeypatch.delenv(given)
        with pytest.raises(RecordingError, match=r"^t\.rrd: there is no display here; give --web .* --screenshot"):
            show(Path("t.rrd"))


class KeptForAThread:
    """As PyAV's scaler, whose end waits for threads of its own, which a fork does not have."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __del__(self) -> None:
        (self.folder / "ended").touch()


def test_a_window_shows_the_recording_until_it_is_closed_from_any_thread(stand: Stand, here, monkeypatch) -> None:
    thread = threading.local()
    thread.kept = KeptForAThread(here)
    monkeypatch.setenv("WAYLAND_DISPLAY", "0")
    with ThreadPoolExecutor(1) as pool:
        pool.submit(show, Path("--t.rrd")).result()
    assert not (here / "ended").exists()
    file, *options = stand.received["arguments"]
    assert file == str(here / "--t.rrd")
    assert options[options.index("--bind") + 1] == "127.0.0.1"
    assert options[options.index("--port") + 1] == "auto"


WAIT = """
import signal, sys
from contextlib import suppress
from epuck_sim.recording import rerun
rerun.PROGRAM = sys.executable, sys.argv[1]
before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
with suppress(KeyboardInterrupt), rerun.in_background() as viewer:
    print("open", flush=True)
    viewer.wait()
assert before == (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM))
print("ended")
"""


def test_a_browser_finds_the_viewer_on_this_machine_only_until_the_block_ends_or_fails(tmp_path) -> None:
    port = free_port()
    for _ in range(2):  # the port is free again
        with pytest.raises(ZeroDivisionError), web_viewer(port) as (server, address, intake):  # noqa: PT012 at its end
            page, marked = urlsplit(address), processes_marked(str(tmp_path))
            assert (page.scheme, page.netloc) == ("http", f"127.0.0.1:{port}")
            assert parse_qs(page.query) == {"url": [f"rerun+http://127.0.0.1:{intake}/proxy"]}
            assert "<title>Rerun Viewer" in answer(address)
            assert not server.has_ended
            connections = [each for number in marked for each in psutil.Process(number).net_connections("tcp")]
            heard = {tuple(each.laddr) for each in connections if each.status == psutil.CONN_LISTEN}
            assert heard == {("127.0.0.1", port), ("127.0.0.1", intake)}
            assert os.getpgrp() not in map(os.getpgid, marked)  # Ctrl-C in a terminal reaches us
            raise ZeroDivisionError
        wait_until(lambda: not processes_marked(str(tmp_path)))


def waiting(stand: Stand):
    """Return a process that waits for its viewer to be closed; its parent ignored signals."""
    stand.acts(SLEEP)
    process = start(["bash", "-c", "trap '' INT TERM; exec \"$@\"", "bash", sys.executable, "-c", WAIT, stand.script])
    assert process.stdout.readline() == "open\n"
    return process


def test_ctrl_c_ends_a_viewer_and_the_wait_for_it_even_if_the_parent_had_it_ignored(stand: Stand) -> None:
    process = waiting(stand)
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate() == ("ended\n", "")
    assert process.returncode == 0


def test_sigterm_ends_the_block_like_ctrl_c_unless_the_program_has_a_handler_of_its_own(stand: Stand) -> None:
    stand.acts(SLEEP)
    caught: list[int] = []
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with pytest.raises(KeyboardInterrupt), in_background():
            os.kill(os.getpid(), signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
        signal.signal(signal.SIGTERM, lambda number, _: caught.append(number))
        with in_background():
            os.kill(os.getpid(), signal.SIGTERM)
            wait_until(lambda: caught == [signal.SIGTERM])
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process together with its parent")
def test_the_viewer_ends_even_if_the_process_that_waits_is_killed(stand: Stand) -> None:
    process = waiting(stand)
    (child,) = psutil.Process(process.pid).children()
    process.kill()
    wait_until(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)


def test_a_browser_gets_the_whole_recording_and_layout_and_nothing_is_done_while_none_looks(thesis, tmp_path) -> None:
    received, complete = tmp_path / "received.rrd", tmp_path / "complete.rrd"

    def has_all() -> bool:
        try:  # what was received has no end: it is added
            run_rerun("rrd", "optimize", str(received), "-o", str(complete))
            return rows_by_entity(complete) == rows_by_entity(thesis[0])
        except (RecordingError, ValueError):
            return False

    def look(address: str) -> None:
        (server,) = map(psutil.Process, processes_marked(str(tmp_path)))
        before = sum(server.cpu_times()[:2])
        time.sleep(1)
        assert sum(server.cpu_times()[:2]) - before < 0.1  # a busy loop: 1 s, or 0.5 s beside other work
        assert answer(address)
        url = parse_qs(urlsplit(address).query)["url"][0]
        with in_background(url, "--save", str(received), "--port", str(free_port())):
            wait_until(has_all)
        raise KeyboardInterrupt  # which ends it well

    serve(thesis[0], free_port(), look)
    got, sent = read_recording(complete), read_recording(thesis[0])
    for found, expected in zip(got._replace(links=None), sent._replace(links=None), strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(got.sightings, sent.sightings)
    assert [layout.application_id for layout in RrdReader(complete).blueprints()] == ["epuck-sim"]
    assert RrdReader(complete).recordings() == RrdReader(thesis[0]).recordings()


def rows_by_entity(path: Path) -> dict[str, int]:
    return {entity: sum(batch.num_rows for batch in batches) for entity, batches in Found(path).moving.items()}


def test_a_viewer_that_ignores_signals_is_ended_all_the_same(stand: Stand, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(rerun, "END_S", 0.2)
    stand.acts(*DEAF)
    with in_background(str(tmp_path / "deaf")) as window:
        wait_until((tmp_path / "deaf").exists)
        assert not window.has_ended
    assert window.has_ended


def test_a_second_ctrl_c_while_it_is_ended_leaves_none_behind(stand: Stand, tmp_path) -> None:
    stand.acts(*DEAF)
    impatient = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), in_background(str(tmp_path / "deaf")) as window:  # noqa: PT012 at its end
            wait_until((tmp_path / "deaf").exists)
            impatient.start()
    finally:
        impatient.join()
        signal.signal(signal.SIGINT, handler)
    assert window.has_ended


def test_a_viewer_that_breaks_down_before_it_has_all_or_later_is_reported(thesis, stand, tmp_path, monkeypatch):
    monkeypatch.setattr(viewer, "FLUSH_S", 0.2)
    stand.answers_and_says("no more of this", senders=1)  # rerun waits 10 s for one that it does not reach
    with pytest.raises(RecordingError, match=r"^the viewer does not work: no more of this$"):
        serve(thesis[0], free_port(), pytest.fail)
    monkeypatch.undo()  # the real program

    def end_it(_: str) -> None:
        for each in processes_marked(str(tmp_path)):
            os.kill(each, signal.SIGKILL)

    with pytest.raises(RecordingError, match=r"^the viewer does not work: it does not answer$"):
        serve(thesis[0], free_port(), end_it)
