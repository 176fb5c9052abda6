"""Ports that browsers or other programs do not leave to us are refused."""

import socket

import pytest

from epuck_sim.errors import PortError
from epuck_sim.util.ports import HOST, check_port, free_port


def test_a_port_at_which_browsers_open_no_page_is_refused() -> None:
    with pytest.raises(PortError, match=r"^port 6000 cannot be used: browsers open no pages there; .* --port$"):
        check_port(6000)


def test_a_free_port_can_be_used_until_a_program_has_it() -> None:
    port = free_port()
    check_port(port)
    with socket.socket() as taken:
        taken.bind((HOST, port))
        taken.listen()
        with pytest.raises(PortError, match=f"^port {port} cannot be used: Address already in use; give another"):
            check_port(port)
    check_port(port)
