"""Ports of this machine at which its browsers find pages."""

import os
import socket

from epuck_sim.errors import PortError

HOST = "127.0.0.1"
"""Address at which pages are served: other machines cannot reach them."""

BLOCKED_PORTS = frozenset(
    {
        *(1, 7, 9, 11, 13, 15, 17, 19, 20, 21, 22, 23, 25, 37, 42, 43, 53, 69, 77, 79, 87, 95, 101, 102, 103, 104, 109),
        *(110, 111, 113, 115, 117, 119, 123, 135, 137, 139, 143, 161, 179, 389, 427, 465, 512, 513, 514, 515, 526, 530),
        *(531, 532, 540, 548, 554, 556, 563, 587, 601, 636, 989, 990, 993, 995, 1719, 1720, 1723, 2049, 3659, 4045),
        *(4190, 5060, 5061, 6000, 6566, *range(6665, 6670), 6679, 6697, 10080),
    }
)
"""Ports at which browsers open no pages, as other protocols have them: the bad ports of the Fetch standard."""


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
            raise PortError(
                f"port {port} cannot be used: {os.strerror(error.errno or 0)}; give another with --port"
            ) from error
