"""Errors that are meant for the person who made them: one readable message each, never a traceback."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

CODE_CHECKS: list[Callable[[Path], object]] = []
"""Checks by a command of each file of code before it is loaded, the last check first; they raise an EpuckSimError."""


class EpuckSimError(Exception):
    """The root of every error that this package raises on purpose."""


class ScenarioError(EpuckSimError):
    """A scenario that cannot be run: names the file, the key, the value given and what is allowed."""


class ControllerError(EpuckSimError):
    """A controller that cannot be loaded or compiled, or that raised while it ran."""


class CurveError(EpuckSimError):
    """A phase response curve that cannot be loaded or compiled, or that raised during a trial."""


class MeasureError(EpuckSimError):
    """A measure that cannot be loaded, that raised during a trial, or that returned no value."""


class StoreError(EpuckSimError):
    """A run folder that cannot be used: it holds something else, is damaged, in use, or cannot be written."""


class RecordingError(EpuckSimError):
    """A recording that cannot be read, written or shown."""


class ClusterError(EpuckSimError):
    """A cluster that cannot be reached, or that is gone."""


class FilmError(EpuckSimError):
    """A film that cannot be read, written, or tracked; or a camera that cannot be opened."""


class PortError(EpuckSimError):
    """A port of this machine at which no page can be shown."""


class ExtraError(EpuckSimError, ModuleNotFoundError):
    """A package that is not installed, and the extra that brings it."""


class NumbaError(EpuckSimError, ImportError):
    """A numba that cannot compile trials; an ImportError, as the server that forks workers ignores those."""


EXTRAS = {
    "IPython": ("ipython", "notebook"),
    "av": ("av", "film"),
    "cv2": ("opencv-python-headless", "film"),
    "distributed": ("distributed", "cluster"),
    "gymnasium": ("gymnasium", "learning"),
    "matplotlib": ("matplotlib", "plot"),
    "pettingzoo": ("pettingzoo", "learning"),
    "pyarrow": ("pyarrow", "table"),
    "rerun": ("rerun-sdk", "view"),
}
"""Packages that no sweep needs, and the extras that install them, by the modules they bring."""


@contextmanager
def extras_named() -> Iterator[None]:
    """Raise ExtraError where the block, or the function that is decorated, lacks a package of `EXTRAS`."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (module := (error.name or "").partition(".")[0]) not in EXTRAS:
            raise
        said = 'this needs {}, which is not installed: pip install "epuck-sim[{}]"'.format(*EXTRAS[module])
        raise ExtraError(said, name=error.name) from error
