"""Firmware in C does what the same controller in Python does, bit for bit; what is wrong with it is said clearly."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from epuck_sim.control import firmware as compiling
from epuck_sim.control.firmware import FLAGS, HEADERS, load_firmware
from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ControllerError
from epuck_sim.util.rng import randint, uniform
from tests.control.bench import MODES, Bench
from tests.tools import needs_compiler

pytestmark = needs_compiler

FIREFLY = Path(__file__).parents[1] / "controllers" / "firmware" / "firefly.c"


def write_firmware(path: Path, step: str = "", head: str = "", memory: str = "E_FLOAT(x)", start: str = ""):
    text = f"#define PARAMETERS E_FLOAT(gain, 2.5) E_INT(whole, -3) E_BOOL(flag, true)\n#define MEMORY {memory}\n"
    path.write_text(f"{text}#include <epuck.h>\n{head}\nvoid start(void) {{{start}}}\nvoid step(void) {{{step}}}\n")
    return find_controller(str(path))


def test_parameters_memory_and_check_are_those_of_the_file_which_needs_neither_list_and_may_have_tables(tmp_path):
    firmware, controller = find_controller(str(FIREFLY)), find_controller("firefly")
    assert firmware.parameters == controller.parameters
    assert list(firmware.parameters) == list(controller.parameters)
    assert firmware.memory == controller.memory
    assert firmware.is_oscillator
    head = 'const char *check(void) { return parameters->gain < 0 ? e_refuse("gain is %g", parameters->gain) : NULL; }'
    firmware = write_firmware(tmp_path / "mine.c", head=head)
    assert firmware.resolve({}) == {"gain": 2.5, "whole": -3, "flag": True}
    with pytest.raises(ValueError, match=r"^gain is -1$"):
        firmware.resolve({"gain": -1})
    (tmp_path / "empty.c").write_text("#include <epuck.h>\nvoid start(void) {}\nvoid step(void) { {} }\n")
    firmware = find_controller(str(tmp_path / "empty.c"))
    assert firmware.resolve({}) == {}
    Bench(firmware, robots=2).control.step()
    head = 'static const char *const NAMES[] = {"a", "b"}; static const double GAINS[] = {1, 2};'  # not shared
    write_firmware(tmp_path / "mine.c", "e_set_led((unsigned)NAMES[e_get_red(1)][0], GAINS[1]);", head=head)


def test_random_numbers_are_those_of_python_and_errors_of_other_controllers_are_not_those_of_firmware(tmp_path):
    step = "memory->x = e_uniform(); memory->n = e_randint(1000);"
    bench = Bench(write_firmware(tmp_path / "mine.c", step, memory="E_FLOAT(x) E_INT(n)"), robots=3)
    streams = bench.streams.copy()
    for _ in range(100):
        bench.control.step()
        assert bench.memory.tolist() == [(uniform(stream), randint(stream, 1000)) for stream in streams]
    assert (bench.streams == streams).all()
    assert bench.control.fault(ValueError("elsewhere")) is None


@MODES
def test_a_robot_reads_its_own_sensors_and_sets_its_own_wheels_and_ring(interpret, tmp_path):
    step = """
    memory->x = 1000.0 * e_get_prox(2) + e_get_calibrated_prox(2) + e_get_prox(8);
    memory->many[1] = e_get_distance_mm(7) + parameters->gain * parameters->whole * parameters->flag;
    memory->many[0] = e_get_pixels() * 100 + e_get_red(59) * 10 + e_get_red(60) + e_poxxxx_is_img_ready();
    memory->whole[2] = e_get_step_ms();
    e_set_speed_left(e_get_prox(2) * 100);
    e_set_speed_right(-500);
    e_set_led(3, 2);
    """
    memory = "E_FLOAT(x) E_FLOATS(many, 2) E_INTS(whole, 3)"
    firmware = write_firmware(tmp_path / "mine.c", step, memory=memory)
    bench = Bench(firmware, robots=2, interpret=interpret)
    bench.senses.infrared[:, 2] = (3, 20)
    bench.senses.distance_mm[:, 7] = (40, 50)
    bench.senses.camera[1, 59] = 1
    bench.senses.new_picture[0] = False
    bench.senses.step_ms[:] = (99, 101)
    bench.control.step()
    assert bench.memory["x"].tolist() == [3003, 20020]
    assert bench.memory["many"].tolist() == [[6000, 32.5], [6011, 42.5]]
    assert bench.memory["whole"].tolist() == [[0, 0, 99], [0, 0, 101]]
    assert bench.actuators["left_cm_s"].tolist() == [300 * 12.8 / 1000, 12.8]
    assert bench.actuators["right_cm_s"].tolist() == [-6.4, -6.4]
    assert bench.actuators["ring_on"].tolist() == [8, 8]
    bench.control.step()
    assert bench.actuators["ring_on"].tolist() == [0, 0]


def test_a_robot_reads_pulses_sends_and_turns_and_sets_leds_one_by_one_or_all(tmp_path):
    step = "memory->x = e_get_pulses() * 100 + e_get_message(7) + e_get_message(8); memory->n += 1;"
    step += "e_set_message(memory->x); e_set_turn_rad(0.5 * e_get_pulses());"
    step += "if (memory->n == 1) e_set_led(8, 1); if (memory->n == 2) e_set_led(0, 0);"
    step += "if (memory->n == 3) e_set_led(9, 2); if (memory->n == 4) e_led_clear(); e_set_body_led(1);"
    bench = Bench(write_firmware(tmp_path / "mine.c", step, memory="E_FLOAT(x) E_INT(n)"), robots=2)
    bench.senses.pulses[:] = 0, 9
    bench.senses.messages[:, 7] = 3, 4
    for leds in (255, 254, 1, 0):
        bench.control.step()
        assert bench.actuators[["send", "turn_rad", "ring_on"]].tolist() == [(3, 0, leds), (904, 4.5, leds)]


def test_a_library_runs_as_its_source_does_and_an_edit_of_either_or_of_what_it_includes_is_noticed(tmp_path):
    tmp_path /= "o'brien's $5: #1"
    tmp_path.mkdir()
    for number in (1, 2):
        (tmp_path / "gain.h").write_text(f"#define GAIN {number}\n")
        source = write_firmware(tmp_path / "a:mine.c", "memory->x += GAIN;", head='#include "gain.h"')
        assert set(source.sources) == {tmp_path / "a:mine.c", tmp_path / "gain.h"}
        command = ["cc", *FLAGS, "-isystem", str(HEADERS), "-shared", "./a:mine.c", "-o", "mine.so"]
        subprocess.run(command, cwd=tmp_path, check=True)
        for firmware in (source, find_controller(str(tmp_path / "mine.so"))):
            bench = Bench(firmware)
            bench.control.step()
            assert bench.memory["x"].tolist() == [number]


def test_a_library_that_is_none_of_something_else_or_without_its_end_is_refused_before_it_is_loaded(tmp_path):
    (tmp_path / "other.c").write_text("int answer(void) { return 42; }\n")
    subprocess.run(["cc", "-shared", "-fPIC", "other.c", "-o", "other.so"], cwd=tmp_path, check=True)
    (tmp_path / "text.so").write_bytes(b"no library")
    for name, said in (("text", ""), ("other", ".*e_version")):
        with pytest.raises(ControllerError, match=rf"{name}\.so: is not firmware that includes <epuck\.h>: {said}"):
            find_controller(str(tmp_path / f"{name}.so"))
    (tmp_path / "mine.c").write_text(FIREFLY.read_text())
    contents = Path(load_firmware(tmp_path / "mine.c").library._name).read_bytes()
    for length in (10, 60, 5000, len(contents) - 1):
        (tmp_path / "cut.so").write_bytes(contents[:length])
        with pytest.raises(ControllerError, match=r"cut\.so: is not a whole library: its end is missing"):
            find_controller(str(tmp_path / "cut.so"))


def test_names_of_macos_begin_with_an_underscore_and_its_linker_has_other_options(tmp_path, monkeypatch):
    stand_ins = {"nm": "%s \"$@\" | sed 's/^[a-z]/_&/'", "cc": 'case "$*" in *-z,defs*) exit 1; esac; exec %s "$@"'}
    for name, script in stand_ins.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{script % shutil.which(name)}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(sys, "platform", "darwin")
    assert write_firmware(tmp_path / "mine.c", head=f"/* never compiled before: {tmp_path} */").library
    with pytest.raises(ControllerError, match=r"mine\.c:4: 'seen' is a variable that all robots would share"):
        write_firmware(tmp_path / "mine.c", head="int seen;")


def test_a_file_is_compiled_once_and_again_by_another_compiler_or_when_damaged_but_not_without(tmp_path, monkeypatch):
    monkeypatch.setattr(compiling, "cache_root", lambda **_: tmp_path / "cache")
    compiled = []
    run = compiling._run
    monkeypatch.setattr(compiling, "_run", lambda path, command: compiled.append("-c" in command) or run(path, command))
    for name in ("a", "b"):
        write_firmware(tmp_path / f"{name}.c")
    (kept,) = (tmp_path / "cache" / "firmware").iterdir()
    assert sum(compiled) == 1
    contents = kept.read_bytes()
    kept.unlink()  # the library is in use: its file may not change
    kept.write_bytes(contents[:5000])
    write_firmware(tmp_path / "a.c")
    assert (kept.read_bytes(), sum(compiled)) == (contents, 2)
    other = tmp_path / "mycc"
    other.write_text(f'#!/bin/sh\n[ "$1" = --version ] && echo mycc 1 && exit\nexec {shutil.which("cc")} "$@"\n')
    other.chmod(0o755)
    monkeypatch.setenv("CC", str(other))
    write_firmware(tmp_path / "d.c")
    assert sum(compiled) == 3
    monkeypatch.setenv("CC", "no-such-compiler -m32")
    with pytest.raises(ControllerError, match=r"e\.c: needs a C compiler, and no-such-compiler is not found; inst"):
        write_firmware(tmp_path / "e.c")
