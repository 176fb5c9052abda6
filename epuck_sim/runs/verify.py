"""Looks at every file of a run folder, and says whether it is whole."""

import hashlib
from pathlib import Path
from typing import NamedTuple

from epuck_sim.errors import StoreError
from epuck_sim.runs.folder import DATABASE, database_of
from epuck_sim.runs.sources import DIGESTS, read_digests
from epuck_sim.runs.status import read_status
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.util.messages import counted


class Verdict(NamedTuple):
    """What was found of one file of a run folder."""

    file: str
    is_whole: bool
    says: str


def verify(folder: Path) -> list[Verdict]:
    """Look at every file of a run folder, and return what each is; nothing in it is run or changed.

    Raises:
        StoreError: It is no run folder.
    """
    database_of(folder)
    try:
        status = read_status(folder)
    except StoreError as error:
        found = [Verdict(DATABASE, False, str(error).removeprefix(f"{folder / DATABASE}: "))]
    else:
        rows = f"{status.stored} of {counted(status.trials, 'trial')} of {status.scenario}, each with its checksum"
        found = [Verdict(DATABASE, True, rows)]
    try:
        digests = read_digests(folder)
    except StoreError as error:
        return [*found, Verdict(DIGESTS, False, str(error).removeprefix(f"{folder / DIGESTS}: "))]
    if digests is None:
        is_there = (folder / RUN_SCENARIO).is_file()
        says = "has no digest: an earlier version has written it" if is_there else "is missing"
        return [*found, Verdict(RUN_SCENARIO, is_there, says)]
    for name, digest in digests.items():
        try:
            is_whole = hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
            says = "is as it was written" if is_whole else "is damaged, or was changed"
        except OSError as error:
            is_whole, says = False, f"cannot be read: {error.strerror}"
        found.append(Verdict(name, is_whole, says))
    return found
