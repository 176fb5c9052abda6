"""Messages about mistakes and slow work: a mistake gets one message and an exit code, no traceback."""

import errno
import sys
import threading
import traceback
import warnings
from bdb import BdbQuit
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

import typer

from epuck_sim.errors import ControllerError, EpuckSimError, ScenarioError, extras_named

SLOW_S = 10.0  # seconds after which a note is printed about work without a progress line


@contextmanager
def exit_on_error() -> Iterator[None]:
    """Turn a user's mistake into one message and exit code 2, Ctrl-C and leaving the debugger into exit code 130."""
    try:
        with extras_named():
            yield
    except (KeyboardInterrupt, BdbQuit) as interrupt:
        print_stderr("interrupted")
        raise typer.Exit(130) from interrupt
    except Exception as error:
        if (message := _message(error)) is None:
            raise
        if _is_open(sys.stderr):
            print_stderr(f"error: {message}")
        raise typer.Exit(2) from error


def _message(error: Exception) -> str | None:
    """Return the message for a user about an error; None for an error of the program."""
    if isinstance(error, EpuckSimError):
        return str(error)
    if isinstance(error, OSError):
        if error.errno == errno.EPIPE:  # the reader of the output has closed it
            return None
        nameless = "the current folder" if error.errno == errno.ENOENT else "the output cannot be written"
        return f"{error.filename or nameless}: {error.strerror or error}"
    if isinstance(error, ValueError) and str(error).startswith("Key backend: "):  # as matplotlib is imported
        return f"MPLBACKEND: {error}"
    is_closed = isinstance(error, ValueError | AttributeError) and not all(map(_is_open, (sys.stdout, sys.stderr)))
    return "the output cannot be written: it was closed" if is_closed else None  # by a controller, say


def _is_open(stream: TextIO | None) -> bool:
    return stream is not None and not stream.closed


@contextmanager
def print_traceback() -> Iterator[None]:
    """Print the traceback of what a controller raises, from its own file on, before the error is reported."""
    try:
        yield
    except ControllerError as error:
        raised: BaseException = error
        while raised.__cause__ is not None:
            raised = raised.__cause__
        frames = traceback.extract_tb(raised.__traceback__)
        files = [frame.filename for frame in frames]
        own = next((number for number, file in enumerate(files) if file in str(error)), 0)
        lines = traceback.format_list(frames[own:]) + traceback.format_exception_only(raised)
        typer.echo("Traceback of the controller:\n" + "".join(lines), err=True, nl=False)
        raise


def _print_warning(said: Warning | str, kind: type[Warning]) -> None:
    if not issubclass(kind, DeprecationWarning):  # what one library says to another, no user can heed
        print_stderr(f"note: {said}")


@contextmanager
def print_warnings() -> Iterator[None]:
    """Print the block's warnings as notes, at once: an error that follows may be due to them."""
    with warnings.catch_warnings(action="always", category=UserWarning):
        warnings.showwarning = lambda said, kind, *_, **__: _print_warning(said, kind)
        yield


def reject_first(*mistakes: tuple[bool, str]) -> None:
    """Raise EpuckSimError with the message of the first condition that is true."""
    for made, message in mistakes:
        if made:
            raise EpuckSimError(message)


@contextmanager
def prefix_scenario(scenario: str) -> Iterator[None]:
    """Prefix errors with the scenario's name, unless they have it."""
    try:
        yield
    except ScenarioError as error:
        named = str(error).startswith((f"{scenario}: ", f"{scenario} --"))
        raise ScenarioError(str(error) if named else f"{scenario}: {error}") from error


def print_stderr(line: str) -> None:
    """Print a line on stderr, at once; what cannot be printed, as on a full disk, ends nothing but a broken pipe."""
    try:
        typer.echo(line, err=True)
    except OSError as error:
        if error.errno == errno.EPIPE:
            raise


@contextmanager
def note_if_slow(doing: str) -> Iterator[Callable[[], None]]:
    """Print a note on stderr if the block takes longer than `SLOW_S`; yield a function that cancels the note."""
    timer = threading.Timer(SLOW_S, print_stderr, (f"{doing} takes a while; Ctrl-C ends it",))
    timer.daemon = True
    timer.start()
    try:
        yield timer.cancel
    finally:
        timer.cancel()
