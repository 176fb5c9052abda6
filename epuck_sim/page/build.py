"""Makes WebAssembly with ziglang, which links it: `python -m epuck_sim.page.build` the modules of pages.

A scenario's own controllers, sensors and response curves are kernels as shipped ones are: for its page they are made
into a module beside the model's, in its memory.

Kernels are taken as numba makes them, before anything in them depends on this machine, and compiled for WebAssembly by
the LLVM that numba brings, without fast-math: each number is the program's, to the bit.
"""

import gzip
import re
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.metadata import version
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import get_args

from epuck_sim.embodied.bodies.chipmunk import FUNCTIONS
from epuck_sim.errors import ScenarioError
from epuck_sim.page.roots import FOLDER, Model, Root, digest_kernels, own_roots, roots
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.machine import in_bytes
from epuck_sim.util.native import compile_elsewhere

TARGET = "wasm32-unknown-unknown"
FEATURES = "+nontrapping-fptoint,+sign-ext,+bulk-memory,+mutable-globals"
"""Features of WebAssembly that every browser of the last five years has."""

LINKING = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-O3", "-DNDEBUG", "-ffp-contract=off", "-Wno-everything"),
    *("-Wl,--gc-sections", "-Wl,--strip-all", "-Wl,--export-table", "-Wl,--growable-table", "-Wl,--export=__heap_base"),
)
"""Options of the compiler and linker."""

SHIM = Path(__file__).with_name("chipmunk.c")

LEFT_OUT = ("cpHastySpace", "cpPolyline", "cpMarch", "cpSpaceDebug")
"""Sources of Chipmunk that the program does not use."""


def compile_kernels(named: Mapping[str, Root]) -> bytes:
    """Return the object file of kernels, which are known outside by their names; ends what else a process compiles."""
    parts = {name: (kernel.part, arguments) for name, (kernel, arguments) in named.items()}
    return compile_elsewhere(parts, TARGET, FEATURES)


def link(kernels: bytes, names: Iterable[str], folder: Path, *sources: object) -> bytes:
    """Return the WebAssembly of kernels in an object file, of `SHIM`, and of further sources in C, given with options.

    It exports functions of these names, beside what `SHIM` exports itself; files are written to the folder.
    """
    made, linked = folder / "kernels.o", folder / "linked.wasm"
    made.write_bytes(kernels)
    exports = (f"-Wl,--export={name}" for name in names)
    command = [sys.executable, "-m", "ziglang", "cc", *LINKING, made, SHIM, *sources, *exports, "-o", linked]
    done = subprocess.run(list(map(str, command)), stderr=subprocess.PIPE, text=True, check=False)
    if lacking := sorted(set(re.findall(r"undefined symbol: (\w+)", done.stderr))):
        raise ScenarioError(
            f"code in a file calls what pages do not have ({', '.join(lacking)}), such as new arrays or lists; "
            "`epuck-sim run` does"
        )
    if done.returncode:
        raise ScenarioError(f"ziglang cannot link the page: {done.stderr.strip()}")
    return linked.read_bytes()


# --- a module of a scenario's own files ---------------------------------------------------------------------

FIRST_BYTE = 18 * 2**20  # of the module's part of the memory: behind what the model's module has from its start on
BYTES = 2**20  # size of that part: its constants, its stack, and what its functions allocate
STACK_BYTES = 2**18

PLACED = (
    *("-Wl,--import-memory", f"-Wl,--initial-memory={FIRST_BYTE + BYTES}"),
    f"-Wl,-z,stack-size={FIRST_BYTE + STACK_BYTES}",  # which grows down from there, and constants stand behind it
)
"""Options of the linker that put a module in its place."""


def compile_own(scenario: EmbodiedScenario | ParticleScenario) -> bytes:
    """Return the module of a scenario's own files, gzipped; nothing if there are none.

    ScenarioError is raised without ziglang, and for a file that calls what pages do not have.
    """
    if not own_roots(scenario):
        return b""
    if find_spec("ziglang") is None:
        what = "controllers, sensors and response curves in files are compiled for a page by ziglang"
        raise ScenarioError(f'{scenario.name}: {what}: pip install "epuck-sim[page]"')
    try:
        with ProcessPoolExecutor(1, get_context("spawn")) as executor:
            return executor.submit(_compile, scenario).result()
    except BrokenProcessPool as error:
        said = "begin it with `if __name__ == '__main__':`, as it is imported where the page's files are compiled"
        raise ScenarioError(f"{scenario.name}: what writes the page in your script must stand below; {said}") from error


def _compile(scenario: EmbodiedScenario | ParticleScenario) -> bytes:
    own = own_roots(scenario)
    with tempfile.TemporaryDirectory() as folder:
        return gzip.compress(link(compile_kernels(own), own, Path(folder), *PLACED), 9, mtime=0)


# --- modules of models ------------------------------------------------------------------------------------


def chipmunk_sources(folder: Path) -> list[object]:
    """Return the sources of Chipmunk, from those of the pymunk that is installed, which pip fetches, and options."""
    wanted = ("--no-deps", "--no-binary=:all:", f"pymunk=={version('pymunk')}")
    subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--dest", folder, *wanted], check=True)
    with tarfile.open(next(folder.glob("pymunk-*.tar.gz"))) as archive:
        archive.extractall(folder, filter="data")
    (found,) = folder.glob("pymunk-*/Munk2D")
    sources = [path for path in sorted((found / "src").glob("*.c")) if path.stem not in LEFT_OUT]
    return ["-DWITH_CHIPMUNK", "-DCP_OVERRIDE_MESSAGE", f"-I{found / 'include'}", *sources]


def main() -> None:
    """Make the module of each model."""
    for model in get_args(Model):
        with tempfile.TemporaryDirectory() as name:
            functions, sources = (FUNCTIONS, chipmunk_sources(Path(name))) if model == "embodied" else ((), ())
            wasm = link(compile_kernels(roots(model)), [*roots(model), *functions], Path(name), *sources)
        packed = gzip.compress(wasm, 9, mtime=0)
        (FOLDER / f"{model}.wasm.gz").write_bytes(packed)
        (FOLDER / f"{model}.digest").write_text(digest_kernels(model) + "\n")
        print(f"{model}: {in_bytes(len(wasm))}, {in_bytes(len(packed))} gzipped")


if __name__ == "__main__":
    main()
