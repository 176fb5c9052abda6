"""The kernels that pages run: a WebAssembly module for each model, made once, for every scenario.

A module is made by `build`, and lies beside this file with the digest of what it is made from (`roots`). Kernels keep
their names in it. What a swarm calls has a number in an array of addresses, as it has in the program; in a page, an
address is an index in the module's table of functions.
"""

from pathlib import Path
from typing import Literal

from epuck_sim.errors import EpuckSimError

Model = Literal["particles", "embodied"]

FOLDER = Path(__file__).parent / "wasm"
"""Where the modules lie, gzipped, each with its digest."""

ANEW = "make it anew: make wasm"


def read_module(model: Model) -> bytes:
    """Return the WebAssembly of a model, gzipped; raise EpuckSimError if it has not been made."""
    path = FOLDER / f"{model}.wasm.gz"
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise EpuckSimError(f"{path}: is missing; {ANEW}") from error
