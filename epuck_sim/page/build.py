"""Makes the WebAssembly modules of pages: `python -m epuck_sim.page.build`, with ziglang, which links them.

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
from importlib.metadata import version
from pathlib import Path
from typing import get_args

from epuck_sim.embodied.bodies.chipmunk import FUNCTIONS
from epuck_sim.errors import ScenarioError
from epuck_sim.page.roots import FOLDER, Model, Root, digest_kernels, roots
from epuck_sim.util.machine import in_bytes
from epuck_sim.util.native import compile_elsewhere

TARGET = "wasm32-unknown-unknown"
FEATURES = "+nontrapping-fptoint,+sign-ext,+bulk-memory,+mutable-globals"
"""What every browser of the last five years knows of WebAssembly."""

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
    """Return the WebAssembly of kernels in an object file and of `SHIM`, which exports functions of these names.

    Args:
        kernels: The object file.
        names: What is exported, beside what `SHIM` exports itself.
        folder: Files are written here.
        sources: Further sources in C, and options.
    """
    made, linked = folder / "kernels.o", folder / "linked.wasm"
    made.write_bytes(kernels)
    exports = (f"-Wl,--export={name}" for name in names)
    command = [sys.executable, "-m", "ziglang", "cc", *LINKING, made, SHIM, *sources, *exports, "-o", linked]
    done = subprocess.run(list(map(str, command)), stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise ScenarioError(_why_not(done.stderr))
    return linked.read_bytes()


def _why_not(said: str) -> str:
    lacking = sorted(set(re.findall(r"undefined symbol: (\w+)", said)))
    if not lacking:
        return f"ziglang cannot link the page: {said.strip()}"
    return (
        f"code in a file calls what pages do not have ({', '.join(lacking)}), such as new arrays or lists; "
        "`epuck-sim run` does"
    )


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
            folder = Path(name)
            is_embodied = model == "embodied"
            exports = [*roots(model), *(function for function in FUNCTIONS if is_embodied)]
            wasm = link(
                compile_kernels(roots(model)), exports, folder, *(chipmunk_sources(folder) if is_embodied else ())
            )
        packed = gzip.compress(wasm, 9, mtime=0)
        (FOLDER / f"{model}.wasm.gz").write_bytes(packed)
        (FOLDER / f"{model}.digest").write_text(digest_kernels(model) + "\n")
        print(f"{model}: {in_bytes(len(wasm))}, {in_bytes(len(packed))} gzipped")


if __name__ == "__main__":
    main()
