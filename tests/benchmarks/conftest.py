"""A table for the benchmarks of a module."""

from collections.abc import Callable, Iterator

import pytest

from tests.benchmarks.measuring import print_table


@pytest.fixture(scope="module")
def show() -> Iterator[Callable[..., None]]:
    """Keep rows by the columns of their table, and print all tables at the end."""
    tables: dict[tuple[str, ...], list[tuple[object, ...]]] = {}
    yield lambda columns, *row: tables.setdefault(columns, []).append(row)
    for columns, rows in tables.items():
        print_table(columns, rows)
