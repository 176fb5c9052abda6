"""How much memory a process may still take here, so that what needs more is refused before it takes any."""

import mmap
from collections.abc import Iterator
from pathlib import Path

from epuck_sim.util.system import address_space

NEGLIGIBLE_BYTES = 64_000_000
"""What needs less is not compared with what there is: to look it up costs as much as the start of a small trial."""

CGROUPS = Path("/sys/fs/cgroup")
"""Where Linux shows what a batch system or a container allows."""

_CGROUP_FILES = (
    ("memory.max", "memory.current", "inactive_file"),
    ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
)
"""Files of the limit and the usage, and the key of what can be dropped, in versions 2 and 1 of control groups."""


def in_bytes(count: float) -> str:
    """Return an amount of memory, or the size of a file.

    >>> in_bytes(999), in_bytes(64_000_000), in_bytes(5.4e9), in_bytes(2e13)
    ('1 kB', '64 MB', '5.4 GB', '20000 GB')
    """
    unit, name = (1e3, "kB") if count < 1e6 else (1e6, "MB") if count < 1e9 else (1e9, "GB")
    return f"{count / unit:.2g} {name}" if count < 100 * unit else f"{count / unit:.0f} {name}"


def lack_of_memory(needed_bytes: int) -> str | None:
    """Return the phrase for what needs more memory than there is; None if there is enough, or little is needed."""
    if needed_bytes < NEGLIGIBLE_BYTES or needed_bytes <= (available := available_bytes()):
        return None
    return f"needs about {in_bytes(needed_bytes)} of memory, and {in_bytes(available)} are available here"


def available_bytes() -> int:
    """Return how much more memory this process may take: what the machine, its control groups and its limits leave."""
    return max(0, min(_of_machine(), *_of_limits(), *_of_cgroups(CGROUPS, _read("/proc/self/cgroup"))))


def _of_machine() -> int:
    for line in _read("/proc/meminfo").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    import psutil  # noqa: PLC0415 - which Linux does not need

    return int(psutil.virtual_memory().available)


def _of_limits() -> Iterator[int]:
    """Yield what `ulimit -v` leaves."""
    limit, pages = address_space(), _read("/proc/self/statm").split()
    if limit is not None and pages:
        yield limit - int(pages[0]) * mmap.PAGESIZE


def _of_cgroups(root: Path, groups: str) -> Iterator[int]:
    """Yield what each control group leaves that this process is in.

    Args:
        root: Where control groups are mounted.
        groups: The contents of /proc/self/cgroup: a line HIERARCHY:CONTROLLERS:PATH for each hierarchy.
    """
    for line in groups.splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers in ("", "memory"):
            inside = Path(path.lstrip("/"))
            for folder in (inside, *inside.parents):
                yield from _of_cgroup(root / controllers / folder)


def _of_cgroup(folder: Path) -> Iterator[int]:
    for limit_file, usage_file, droppable_key in _CGROUP_FILES:
        limit, usage = _read(folder / limit_file).strip(), _read(folder / usage_file).strip()
        if limit.isdecimal() and usage.isdecimal():
            kept = dict(line.split() for line in _read(folder / "memory.stat").splitlines())
            yield int(limit) - int(usage) + int(kept.get(droppable_key, 0))


def _read(path: str | Path) -> str:
    try:
        return Path(path).read_text()
    except OSError:
        return ""
