"""Firmware in C: compiles a file with the system's compiler, or takes a library, and reads its description of itself.

A file is compiled once for its contents, and its library kept in the folder of compiled code.
"""

import ctypes
import hashlib
import os
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from epuck_sim.control.interface import Controller
from epuck_sim.errors import ControllerError
from epuck_sim.user_files import Value, parameter_type, record_type, typed
from epuck_sim.util.cache_folder import cache_root, remove_unused

HEADERS = Path(__file__).with_name("include")  # folder of the header `epuck.h`

# a product and a sum are not fused into one operation, which would round once: so results equal Python's everywhere
FLAGS = ("-std=gnu11", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-g1")  # options of the compiler

ERRORS = ("-Werror=implicit-function-declaration", "-Werror=incompatible-pointer-types", "-Werror=int-conversion")
"""Warnings that are errors in newer versions of C."""

OWN_VARIABLES = {"memory", "parameters", "e_swarm", "e_robot", "e_refusal"}
"""Variables of the header; each thread has its own."""

SHARED_RANDOM = {"rand", "srand", "random", "srandom", "drand48", "srand48", "lrand48", "rand_r"}
"""Functions whose random numbers do not come from the robot's own stream."""

FOR_THE_ROBOT = re.compile(r"p30F6014A\.h|\be_init_\w+|\bmain\s*(?=\()")
"""Marks of firmware that is written for the robot itself."""

FOR_THE_ROBOT_ITSELF = (
    "is for the robot itself; here the simulator calls the firmware. Change three things: #include <epuck.h> instead "
    "of the robot's own headers, void start(void) for what main does once, void step(void) for one turn of its loop; "
    "see docs/firmware.md"
)

VERSION = 1  # version of the header `epuck.h`, which a library states
KINDS: Mapping[bytes, type] = {b"f": float, b"i": int, b"b": bool}  # types of fields by the letters of the header


@dataclass(frozen=True, eq=False)
class Firmware(Controller):
    """A controller in C, as its library describes it."""

    library: ctypes.CDLL  # the library, loaded into this process

    def check_values(self, values: Mapping[str, Value]) -> None:
        """Raise ValueError also for parameters that the library's `e_check` refuses."""
        super().check_values(values)
        record = self.parameter_record(values)
        refusal = self.library.e_check(ctypes.c_void_p(record.ctypes.data))
        if refusal is not None:
            raise ValueError(refusal.decode(errors="replace") or "check: refuses the parameters")


class _Field(ctypes.Structure):
    """A parameter, or a part of the memory: `e_field` of the header."""

    _fields_ = (
        ("name", ctypes.c_char * 64),
        ("kind", ctypes.c_char),
        ("count", ctypes.c_int64),
        ("offset", ctypes.c_int64),
        ("value", ctypes.c_double),
    )


def load_firmware(path: Path) -> Firmware:
    """Return the firmware of a file in C, or of a library compiled from one; errors quote the compiler."""
    file, sources = _build_library(path) if path.suffix == ".c" else _keep_library(path)
    try:
        library = ctypes.CDLL(str(file))
        version = ctypes.c_int64.in_dll(library, "e_version").value
        fields = {part: _read_fields(library, f"e_{part}_fields") for part in ("parameter", "memory")}
    except (OSError, ValueError) as error:
        raise ControllerError(f"{path}: is not firmware that includes <epuck.h>: {error}") from error
    if version != VERSION:
        raise ControllerError(f"{path}: was compiled with version {version} of epuck.h; compile it with {VERSION}")
    try:
        defaults = {name: _default(name, field) for name, field in fields["parameter"].items()}
        parameters = parameter_type(defaults)
        kinds = {name: (KINDS[field.kind], field.count) for name, field in fields["memory"].items()}
        memory = record_type({name: (kind, count) if count else kind for name, (kind, count) in kinds.items()})
    except ValueError as error:
        raise ControllerError(f"{path}: PARAMETERS or MEMORY: {error}") from error
    for record, named in ((parameters, fields["parameter"]), (memory, fields["memory"])):
        offsets = {name: each[1] for name, each in (record.fields or {}).items()}
        if any(offsets[name] != field.offset for name, field in named.items()):
            raise ControllerError(f"{path}: PARAMETERS or MEMORY: an array has no numbers; give it 1 or more")
    library.e_check.restype = ctypes.c_char_p
    return Firmware(path.stem, str(path), path, defaults, None, sources, {}, memory, _in_c, _in_c, (), library)


def _in_c(*_: object) -> None: ...


def _read_fields(library: ctypes.CDLL, name: str) -> dict[str, _Field]:
    first = _Field.in_dll(library, name)
    fields: dict[str, _Field] = {}
    for index in range(10_000):
        field = _Field.from_address(ctypes.addressof(first) + index * ctypes.sizeof(_Field))
        if not field.name:
            return fields
        fields[field.name.decode()] = field
    raise ValueError(f"{name} does not end")


def _default(name: str, field: _Field) -> Value:
    if field.count:
        raise ValueError(f"{name} is an array; parameters are single numbers")
    default: Value = KINDS[field.kind](field.value)
    if default != field.value and field.kind != b"f":
        raise ValueError(f"{name} is {field.value:g}; allowed: a whole number in E_INT, true or false in E_BOOL")
    return typed(name, default, default)


def _keep_library(path: Path) -> tuple[Path, dict[Path, bytes]]:
    """Return a copy of a library, named after its contents, and the contents; a loaded file must not change."""
    contents = path.read_bytes()
    if contents[:6] == b"\x7fELF\x02\x01":  # of Linux, 64 bits: its last part is the table of sections
        head = contents[:64].ljust(64, b"\xff")  # a shorter one would end nowhere
        (begin,), (size, count) = struct.unpack_from("<Q", head, 40), struct.unpack_from("<HH", head, 58)
        if begin + size * count > len(contents):  # to load it would end the process
            raise ControllerError(f"{path}: is not a whole library: its end is missing")
    return _library([contents], lambda part: part.write_bytes(contents)), {path: contents}


def _build_library(path: Path) -> tuple[Path, dict[Path, bytes]]:
    """Return the library of a C file, and the contents of the files it is made from, except the compiler's own."""
    compiler = shlex.split(os.environ.get("CC", "cc")) or ["cc"]
    if shutil.which(compiler[0]) is None:
        said = f"needs a C compiler, and {compiler[0]} is not found; install gcc or clang, name one in CC"
        raise ControllerError(f"{path}: {said}, or give the library (.so) that the file was compiled to elsewhere")
    _, _, files = _run(path, [*compiler, *FLAGS, "-isystem", HEADERS, "-MM", "-MT", "code", path]).partition(":")
    named = re.findall(r"(?:\\.|[^\s\\])+", files.replace("\\\n", " "))  # with the quotes of `make`
    own = [Path(re.sub(r"\\(.)", r"\1", file).replace("$$", "$")).resolve() for file in named]
    sources = {file: file.read_bytes() for file in dict.fromkeys([path, *own])}
    version = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False).stdout
    settings = repr((compiler, version, FLAGS, ERRORS)).encode()

    def build(part: Path) -> None:
        code = part.with_name("code.o")
        _run(path, [*compiler, *FLAGS, *ERRORS, "-isystem", HEADERS, "-c", path, "-o", code])
        _reject_shared(code, sources)
        whole = [] if sys.platform == "darwin" else ["-Wl,-z,defs"]  # what a linker of macOS does by itself
        _run(path, [*compiler, "-shared", *whole, code, "-o", part, "-lm"])

    contents = [settings, (HEADERS / "epuck.h").read_bytes(), *sources.values()]
    return _library(contents, build), sources


def _run(path: Path, command: Sequence[str | Path]) -> str:
    """Return the output of a command; raise ControllerError with its own words if it fails."""
    run = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False, errors="replace")
    if run.returncode:
        source = path.read_text(errors="replace")
        if found := FOR_THE_ROBOT.search(source):
            line = source.count("\n", 0, found.start()) + 1
            raise ControllerError(f"{path}:{line}: {found[0]!r}: {FOR_THE_ROBOT_ITSELF}")
        if missing := re.search(r"""(?:undefined reference to .|"_)(start|step)['"]""", run.stderr):
            raise ControllerError(f"{path}: has no function void {missing[1]}(void), which the simulator calls")
        said = "\n".join(f"  {line}" for line in (run.stderr or run.stdout).splitlines())
        _, *rest = re.split(r"""#\s*include\s*[<"]epuck\.h[>"]""", source, maxsplit=1)
        lacking = re.search(r"(?:implicit declaration of|undeclared) function .(e_\w+)", said)
        if rest and re.search(r"#\s*define\s+(PARAMETERS|MEMORY)\b", rest[0]):
            said += "\n  PARAMETERS and MEMORY come before #include <epuck.h>"
        elif lacking and not rest and '#include "' not in source:  # which may include it
            said += "\n  the file has no #include <epuck.h>"
        elif lacking:
            said += f"\n  epuck.h has no {lacking[1]}: docs/firmware.md says what is simulated"
        raise ControllerError(f"{path}: {command[0]} cannot compile it:\n{said}")
    return run.stdout


def _reject_shared(code: Path, sources: Mapping[Path, bytes]) -> None:
    lister = shutil.which("nm")
    if lister is None:
        return
    table = subprocess.run([lister, "-f", "sysv", code], capture_output=True, text=True, check=False).stdout
    rows = [[part.strip() for part in line.split("|")] for line in table.splitlines() if line.count("|") == 6]
    for listed, _, kind, _, _, _, section in rows:
        name = listed.removeprefix("_" * (sys.platform == "darwin"))  # where all names begin so
        plain = name.partition(".")[0]  # `count.0` is a variable inside a function
        is_variable = kind in "bBdDC" and not section.startswith(".data.rel.ro")
        if name == "main":
            said = f"{name!r}: {FOR_THE_ROBOT_ITSELF}"
        elif is_variable and plain not in OWN_VARIABLES:
            advice = "make it a part of MEMORY, where each robot has its own, or const"
            said = f"{plain!r} is a variable that all robots would share; {advice}"
        elif kind == "U" and plain in SHARED_RANDOM:
            said = f"{plain}() is shared by all robots; use e_randint() or e_uniform()"
        else:
            continue
        raise ControllerError(f"{_line_of(plain, sources)}: {said}")


def _line_of(name: str, sources: Mapping[Path, bytes]) -> str:
    """Return FILE:LINE of the first line that has a name; the first line of all if none has."""
    for file, text in sources.items():
        for number, line in enumerate(text.decode(errors="replace").splitlines(), 1):
            if re.search(rf"\b{re.escape(name)}\b", line):
                return f"{file}:{number}"
    return f"{next(iter(sources))}:1"


def _library(contents: Iterable[bytes], make: Callable[[Path], object]) -> Path:
    """Return the library made from these contents, named after their digest and its own: damaged ones are made anew."""
    folder = cache_root() / "firmware"
    if not folder.is_dir():
        folder = cache_root(to_fill=True) / "firmware"
    folder.mkdir(parents=True, exist_ok=True)
    made_from = _digest(b"".join(hashlib.sha256(each).digest() for each in contents))
    for library in folder.glob(f"{made_from}-*.so"):
        if library.stem == f"{made_from}-{_digest(library.read_bytes())}":
            os.utime(library)
            break
    else:
        with tempfile.TemporaryDirectory(dir=folder) as own:
            part = Path(own) / "library"
            make(part)
            library = folder / f"{made_from}-{_digest(part.read_bytes())}.so"
            part.replace(library)
    remove_unused(folder.glob("*.so"), Path.is_file)
    return library


def _digest(contents: bytes) -> str:
    return hashlib.sha256(contents).hexdigest()[:32]
