"""Which options of `run` do not go together."""

from pathlib import Path

from epuck_sim.cli.observers import RunOptions


def find_conflicts(options: RunOptions, folder: Path | None) -> list[tuple[bool, str]]:
    """Return what is wrong with options that are given together: whether it is the case, and the message."""
    trace, record, film = options.trace, options.record, options.film
    return [
        (
            folder is None and (options.workers is not None or options.dask is not None),
            "--workers and --dask need a run folder: --out FOLDER",
        ),
        (folder is None and options.share is not None, "--share needs a run folder of its own: --out FOLDER"),
        (
            folder is not None and any(each is not None for each in (trace, record, film, options.live)),
            "a sweep keeps no traces, recordings and films; --point and --trial run one trial again, with them",
        ),
        (
            trace is not None and trace in (record, film),
            f"--trace and {'--record' if trace == record else '--film'} name the same file",
        ),
        (
            trace is not None and trace.suffix != ".parquet",
            f"--trace is {trace}; allowed: a name that ends in .parquet",
        ),
        (
            film is not None and film.suffix != ".mp4",
            f"--film is {film}; allowed: a name that ends in .mp4",
        ),
        (options.workers is not None and options.dask is not None, "--workers and --dask exclude each other"),
    ]
