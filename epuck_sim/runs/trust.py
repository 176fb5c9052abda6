"""Code in run folders that this user trusts: what somebody else's folder brings is not run unasked."""

import hashlib
from contextlib import suppress
from pathlib import Path

import platformdirs

from epuck_sim.errors import StoreError
from epuck_sim.runs.folder import DATABASE
from epuck_sim.scenario.loader import RUN_SCENARIO, SCENARIO

CODE = (".py", ".c", ".h", ".so")
"""Endings of files that are run, or compiled and run."""

_trusted: set[str] = set()
"""Digests of the code that was trusted in this process."""


def _trusted_file() -> Path:
    return platformdirs.user_state_path("epuck-sim") / "trusted"


def run_folder_of(scenario: str | Path) -> Path | None:
    """Return the run folder that is given as a scenario, or by its scenario's file; None if none is."""
    if str(scenario) in SCENARIO.shipped():
        return None
    path = Path(scenario)
    folder = path.parent if path.name == RUN_SCENARIO else path
    return folder if (folder / DATABASE).is_file() else None


def code_in(folder: Path) -> dict[str, bytes]:
    """Return the code that lies in a run folder, by the names of files in it."""
    files = sorted(path for path in folder.rglob("*") if path.suffix in CODE and path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def _digest(code: dict[str, bytes]) -> str:
    each = (f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in code.items())
    return hashlib.sha256("".join(each).encode()).hexdigest()


def is_trusted(folder: Path) -> bool:
    """Return whether a run folder has no code, or this user has put it there by a run, or has trusted it."""
    code = code_in(folder)
    if not code or (digest := _digest(code)) in _trusted:
        return True
    try:
        return digest in _trusted_file().read_text(encoding="ascii").split()
    except (OSError, UnicodeDecodeError):
        return False


def trust(folder: Path) -> None:
    """Trust the code that lies in a run folder now; where that cannot be kept, for this process alone."""
    if is_trusted(folder):
        return
    digest = _digest(code_in(folder))
    _trusted.add(digest)
    with suppress(OSError):
        _trusted_file().parent.mkdir(parents=True, exist_ok=True)
        with _trusted_file().open("a", encoding="ascii") as file:
            file.write(f"{digest}\n")


def check_trusted(scenario: str | Path) -> None:
    """Raise StoreError if what is given as a scenario is a run folder with code that this user does not trust."""
    folder = run_folder_of(scenario)
    if folder is not None and not is_trusted(folder):
        names = ", ".join(code_in(folder))
        raise StoreError(
            f"{folder}: brings code that you have not run: {names}; look at it, and if you trust it, give --trust to "
            "`run`, `plan` or `replay`, which then run it as you"
        )
