"""`epuck-sim`, and `python -m epuck_sim`."""

import atexit
import gc
import os
import signal


def main() -> None:
    """Run the command; worker processes import this module, too, and must not wait for the command line."""
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # it would look through all installed packages
    gc.set_threshold(300_000, 50, 50)  # imports make a quarter of a million objects, and no garbage
    atexit.register(gc.freeze)  # leaves nothing to the last collections: an eighth of a command's time
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # until there is a handler, Ctrl-C ends it without a traceback
    from epuck_sim.cli.app import main as run_command  # noqa: PLC0415

    run_command()


if __name__ == "__main__":
    main()
