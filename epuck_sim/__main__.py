"""`epuck-sim`, and `python -m epuck_sim`."""

import sys


def main() -> None:
    """Run the command; worker processes import this module, too, and must not wait for the command line.

    Raises:
        SystemExit: On Windows, whose signals and processes differ, at once and with a word on what to do.
    """
    if sys.platform == "win32":
        sys.exit("error: epuck-sim does not run on Windows itself; it does in the Windows Subsystem for Linux (wsl)")
    from epuck_sim.cli.app import main as run_command  # noqa: PLC0415

    run_command()


if __name__ == "__main__":
    main()
