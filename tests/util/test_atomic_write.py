"""Files appear under their names when they are whole, and nothing else in their folder is touched."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.folder import DATABASE
from epuck_sim.util.atomic_write import atomic_write, is_leftover, remove_unfinished, temporary_path


def test_a_user_s_part_stays_as_do_permissions_and_links_and_new_files_have_those_of_the_umask(tmp_path) -> None:
    own = tmp_path / "table.csv.part"
    own.write_text("mine")
    with atomic_write(tmp_path / "table.csv") as part:
        part.write_text("new")
    assert (tmp_path / "table.csv").read_text() == "new"
    assert own.read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 2
    (tmp_path / "elsewhere").mkdir()
    target, link = tmp_path / "elsewhere" / "secret.csv", tmp_path / "link.csv"
    target.touch(0o600)
    link.symlink_to(target)
    with atomic_write(link) as part:
        part.write_text("new")
    assert link.is_symlink()
    assert (target.read_text(), target.stat().st_mode & 0o777) == ("new", 0o600)
    assert [path.name for path in target.parent.iterdir()] == ["secret.csv"]
    for mask in (0o022, 0o077, 0o002):
        before = os.umask(mask)
        try:
            with atomic_write(tmp_path / f"{mask}.csv") as part:
                part.write_text("new")
        finally:
            os.umask(before)
        assert (tmp_path / f"{mask}.csv").stat().st_mode & 0o777 == 0o666 & ~mask


def test_two_writers_of_one_file_each_publish_a_whole_one(tmp_path) -> None:
    target, both = tmp_path / "table.csv", threading.Barrier(2, timeout=60)
    found = []

    def write(letter: str) -> None:
        with atomic_write(target) as part, part.open("w") as file:
            for _ in range(100):
                both.wait()
                file.write(letter * 1000)
        found.append(target.read_text())

    writers = [threading.Thread(target=write, args=(letter,)) for letter in "ab"]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert set(found) <= {"a" * 100_000, "b" * 100_000}
    assert len(found) == 2
    assert list(tmp_path.iterdir()) == [target]


def test_an_error_leaves_the_old_file_and_nothing_else_and_a_file_that_nobody_wrote_is_one(tmp_path) -> None:
    target = tmp_path / "table.csv"
    said = r"table\.csv: cannot be written: No such file"
    with pytest.raises(EpuckSimError, match=said), atomic_write(target):
        pass
    assert list(tmp_path.iterdir()) == []
    target.write_text("old")
    for error in (ValueError, OSError, KeyboardInterrupt, SystemExit):
        raised = EpuckSimError if error is OSError else error
        with pytest.raises(raised), atomic_write(target) as part:  # noqa: PT012 something is written before
            part.write_text("half")
            raise error
        assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"table.csv": "old"}


def test_temporary_files_and_folders_can_be_removed_from_outside_their_blocks(tmp_path) -> None:
    with temporary_path(tmp_path / "a.csv") as file, temporary_path(tmp_path / "b.rrd") as folder:
        file.write_text("half")
        folder.mkdir()
        (folder / "data").write_text("half")
        remove_unfinished()
        assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_leaves_is_known_by_its_name_and_goes_when_the_file_is_written_later(tmp_path) -> None:
    program = (
        "import os, sys; from pathlib import Path; from epuck_sim.util.atomic_write import atomic_write\n"
        "with atomic_write(Path(sys.argv[1])) as part:\n    part.touch()\n    os._exit(9)"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    subprocess.run([sys.executable, "-c", program, tmp_path / DATABASE], env=environment, check=False)
    (left,) = tmp_path.iterdir()
    assert is_leftover(left.name, DATABASE)
    left.unlink()
    others = ("table.csv.part", "table.csv.0123abc.part", "table.csv.0123ABCD.part", "other.csv.0123abcd.part")
    names = ("table.csv.0123abcd.part", "table.csv.0123abce.part", *others)
    for name in names:
        (tmp_path / name).touch()
    for name in names[:1] + names[2:]:
        os.utime(tmp_path / name, (0, 0))
    with atomic_write(tmp_path / "table.csv") as part:
        part.write_text("new")
    assert {path.name for path in tmp_path.iterdir()} == {"table.csv", *names[1:]}
