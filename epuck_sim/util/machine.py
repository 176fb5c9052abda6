"""The machine: signals, limits of a process, memory and ports, as far as its system has them.

Where signals or limits are missing, none applies.
"""

import mmap
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path

from epuck_sim.errors import PortError

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]


def signals(*names: str) -> tuple[signal.Signals, ...]:
    """Return the signals of these names that this system has."""
    return tuple(signal.Signals[name] for name in names if hasattr(signal, name))


@contextmanager
def blocked(*names: str) -> Iterator[None]:
    """Leave signals to this process: processes started in the block, and their children, do not receive them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals(*names))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def allow_files(needed: int) -> int | None:
    """Raise this process's limit of open files to what is needed; return the hard limit instead if that is lower."""
    if resource is None:
        return None
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if resource.RLIM_INFINITY != hard < needed:
        return hard
    if resource.RLIM_INFINITY != soft < needed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
    return None


NEGLIGIBLE_BYTES = 64_000_000  # need below which free memory is not looked up: in that time a small trial starts

CGROUPS = Path("/sys/fs/cgroup")  # where Linux shows what a batch system or a container allows

_CGROUP_FILES = (
    ("memory.max", "memory.current", "inactive_file"),
    ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
)
"""Files of limit and usage, and the key of memory that can be dropped, in versions 2 and 1 of control groups."""


def in_bytes(count: float) -> str:
    """Return an amount of memory, or the size of a file.

    >>> [in_bytes(count) for count in (145, 145_000, 999_999, 1_000_000, 64_000_000, 5.4e9, 2e13)]
    ['0.14 kB', '145 kB', '1000 kB', '1 MB', '64 MB', '5.4 GB', '20000 GB']
    """
    unit, name = (1e3, "kB") if count < 1e6 else (1e6, "MB") if count < 1e9 else (1e9, "GB")
    return f"{count / unit:.2g} {name}" if count < 100 * unit else f"{count / unit:.0f} {name}"


def lack_of_memory(needed_bytes: int) -> str | None:
    """Return the phrase for a lack of memory; None if there is enough, or if little is needed."""
    if needed_bytes < NEGLIGIBLE_BYTES or needed_bytes <= (available := available_bytes()):
        return None
    return f"needs about {in_bytes(needed_bytes)} of memory, and {in_bytes(available)} are available here"


def available_bytes() -> int:
    """Return how much more memory this process may take: what the machine, its control groups and its limits leave."""
    import psutil  # noqa: PLC0415 - which nothing else needs

    left = [int(psutil.virtual_memory().available), *_of_cgroups(CGROUPS, _read("/proc/self/cgroup"))]
    pages = _read("/proc/self/statm").split()
    if resource is not None and pages and (limit := resource.getrlimit(resource.RLIMIT_AS)[0]) >= 0:
        left.append(limit - int(pages[0]) * mmap.PAGESIZE)  # what `ulimit -v` leaves
    return max(0, min(left))


def _of_cgroups(root: Path, groups: str) -> Iterator[int]:
    """Yield what each control group below `root` leaves; groups: this process's lines HIERARCHY:CONTROLLERS:PATH."""
    ours = [line.split(":", 2) for line in groups.splitlines()]
    inside = [(controllers, Path(path.lstrip("/"))) for _, controllers, path in ours if controllers in ("", "memory")]
    folders = [root / controllers / folder for controllers, own in inside for folder in (own, *own.parents)]
    for folder, (limit_file, usage_file, droppable_key) in product(folders, _CGROUP_FILES):
        limit, usage = _read(folder / limit_file).strip(), _read(folder / usage_file).strip()
        if limit.isdecimal() and usage.isdecimal():
            kept = dict(line.split() for line in _read(folder / "memory.stat").splitlines())
            yield int(limit) - int(usage) + int(kept.get(droppable_key, 0))


def _read(path: str | Path) -> str:
    try:
        return Path(path).read_text()
    except OSError:
        return ""


HOST = "127.0.0.1"  # address at which pages are served: other machines cannot reach them

BLOCKED_PORTS = {
    *(1, 7, 9, 11, 13, 15, 17, 19, 20, 21, 22, 23, 25, 37, 42, 43, 53, 69, 77, 79, 87, 95, 101, 102, 103, 104, 109),
    *(110, 111, 113, 115, 117, 119, 123, 135, 137, 139, 143, 161, 179, 389, 427, 465, 512, 513, 514, 515, 526, 530),
    *(531, 532, 540, 548, 554, 556, 563, 587, 601, 636, 989, 990, 993, 995, 1719, 1720, 1723, 2049, 3659, 4045),
    *(4190, 5060, 5061, 6000, 6566, *range(6665, 6670), 6679, 6697, 10080),
}
"""Ports at which browsers open no pages, as other protocols use them: the bad ports of the Fetch standard."""


def free_port() -> int:
    """Return a port at which no program listens."""
    with socket.socket() as found:
        found.bind((HOST, 0))
        return int(found.getsockname()[1])


def check_port(port: int) -> None:
    """Raise PortError if a port is in use, reserved, or one that browsers do not open."""
    if port in BLOCKED_PORTS:
        raise PortError(f"port {port} cannot be used: browsers open no pages there; give another with --port")
    with socket.socket() as attempt:
        attempt.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            attempt.bind((HOST, port))
        except OSError as error:
            said = os.strerror(error.errno or 0)
            raise PortError(f"port {port} cannot be used: {said}; give another with --port") from error
