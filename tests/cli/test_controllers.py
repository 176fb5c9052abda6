"""Controllers on the command line: what is said of errors in them, and which one runs."""

import pytest

from tests.cli.commands import call, refused
from tests.control.bench import with_step

SHORT = ["--set", "stop.max_time_s=1", "--json"]


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def scene(folder, **files):
    """Write files, and a scenario of one robot with the controller `mine.py`."""
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)
    (folder / "scene.yaml").write_text("robots: [{controller: mine.py, count: 1}]\n")
    return ["run", "scene.yaml", *SHORT]


HELPED = {
    "helper": "def halve(x):\n    raise RuntimeError('no half')\n",
    "mine": "import helper\n" + with_step("memory.x = helper.halve(sensors.step_ms)"),
}


def test_a_misspelt_name_ends_the_command_with_file_line_and_the_nearest_name(tmp_path):
    command = scene(tmp_path, mine=with_step("memory.wiat = 1", MEMORY="{'wait': int}"))
    assert f"{tmp_path}/mine.py:9: memory has no 'wiat'; did you mean 'wait'?" in refused(*command)


def test_traceback_shows_the_controller_s_own_lines_alone(tmp_path):
    result = call(*scene(tmp_path, **HELPED), "--interpret", "--traceback")
    assert result.exit_code == 2
    assert result.stderr.startswith(f'Traceback of the controller:\n  File "{tmp_path}/mine.py", line 10, in step\n')
    assert f'  File "{tmp_path}/helper.py", line 2, in halve\n    raise RuntimeError' in result.stderr
    assert result.stderr.splitlines()[-1].startswith("error: ")
    assert "helper.py:2: RuntimeError: no half (in the controller" in result.stderr


def test_without_traceback_there_is_none(tmp_path):
    assert "helper.py:2: RuntimeError: no half" in refused(*scene(tmp_path, **HELPED), "--interpret")


def test_traceback_of_compiled_code_or_of_a_sweep_is_refused(tmp_path):
    assert "--traceback is for --interpret" in refused(*scene(tmp_path, **HELPED), "--traceback")
    assert "--traceback is for single trials" in refused(
        *scene(tmp_path, **HELPED), "--interpret", "--traceback", "--out", "run"
    )
