"""Compiled code that walks through the pages of a table WITHOUT ROWID and compares each row with its checksum.

The format of files: https://www.sqlite.org/fileformat2.html. This code may give up on a sound file,
but it must never accept a damaged one.
"""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.runs.row_kernels import Columns, Scratch, big_endian, has_checksum, read_varint
from epuck_sim.util.jit import jit_inline, jit_no_alloc

INTERIOR, LEAF = 2, 10
"""Types of the pages of such a table; rows are in both."""

GIVEN_UP = -1
"""Number of rows if one does not have its checksum, or if the file is not understood."""

SMALLEST_CELL = 4
"""Bytes that a cell of a page takes at least."""

FILE_HEADER, FRAME_HEADER = 32, 24
"""Bytes before the first frame of a write-ahead log, and before the page in each."""


class Pages(NamedTuple):
    """A database as one reader sees it."""

    file: ByteArray
    """The database file."""
    journal: ByteArray
    """The write-ahead log."""
    in_journal: IntArray
    """(pages + 1,) where the journal has the present contents of each page; 0 where the file has them."""
    page_size: int
    usable: int
    """Bytes of a page that hold contents."""


class Walk(NamedTuple):
    """Which pages are still to be looked at."""

    waiting: IntArray
    """(pages + 1,) stack of page numbers."""
    height: IntArray
    """(1,) how many are in the stack."""
    left: IntArray
    """(1,) how many pages may still be looked at, so that a tree with a loop comes to an end."""
    long_record: ByteArray
    """Memory for a record that has more than one page."""


@jit_no_alloc
def check_pages(pages: Pages, walk: Walk, columns: Columns, scratch: Scratch, count: int) -> int:
    """Look at up to `count` more pages; return the number of rows in them, or `GIVEN_UP`."""
    rows = 0
    for _ in range(count):
        if walk.height[0] == 0:
            break
        walk.height[0] -= 1
        number = walk.waiting[walk.height[0]]
        walk.left[0] -= 1
        if walk.left[0] < 0 or not 1 < number < len(pages.in_journal):
            return GIVEN_UP
        place = pages.in_journal[number]
        if place > 0:
            found = _check_page(pages.journal, place, pages, walk, columns, scratch)
        elif number * pages.page_size <= len(pages.file):
            found = _check_page(pages.file, (number - 1) * pages.page_size, pages, walk, columns, scratch)
        else:
            return GIVEN_UP
        if found == GIVEN_UP:
            return GIVEN_UP
        rows += found
    return rows


@jit_no_alloc
def _check_page(data: ByteArray, begin: int, pages: Pages, walk: Walk, columns: Columns, scratch: Scratch) -> int:
    """Check the rows in a page, and put the pages below it into the stack; return the number of rows."""
    kind, cells, end = data[begin], big_endian(data, begin + 3, 2), begin + pages.usable
    header = 12 if kind == INTERIOR else 8
    if kind not in (INTERIOR, LEAF) or header + 2 * cells > pages.usable:
        return GIVEN_UP
    if kind == INTERIOR and not _push(walk, big_endian(data, begin + 8, 4)):
        return GIVEN_UP
    for cell in range(cells):
        place = begin + big_endian(data, begin + header + 2 * cell, 2)
        if place + SMALLEST_CELL > end:
            return GIVEN_UP
        if kind == INTERIOR:
            if not _push(walk, big_endian(data, place, 4)):
                return GIVEN_UP
            place += 4
        if not _check_cell(data, place, end, pages, walk, columns, scratch):
            return GIVEN_UP
    return cells


@jit_inline
def _push(walk: Walk, number: int) -> bool:
    if walk.height[0] == len(walk.waiting):
        return False
    walk.waiting[walk.height[0]] = number
    walk.height[0] += 1
    return True


@jit_no_alloc
def _check_cell(
    data: ByteArray, begin: int, end: int, pages: Pages, walk: Walk, columns: Columns, scratch: Scratch
) -> bool:
    """Return whether the row in a cell has its checksum."""
    size, place = read_varint(data, begin, end)
    if size < 0:
        return False
    most = (pages.usable - 12) * 64 // 255 - 23
    if size <= most:
        return place + size <= end and has_checksum(data, place, place + size, columns, scratch)
    if size > len(walk.long_record):
        return False
    least = (pages.usable - 12) * 32 // 255 - 23
    here = least + (size - least) % (pages.usable - 4)
    if here > most:
        here = least
    if place + here + 4 > end:
        return False
    for byte in range(here):
        walk.long_record[byte] = data[place + byte]
    return _read_rest(pages, big_endian(data, place + here, 4), walk, here, size) and has_checksum(
        walk.long_record, 0, size, columns, scratch
    )


@jit_no_alloc
def _read_rest(pages: Pages, number: int, walk: Walk, written: int, size: int) -> bool:
    """Append what further pages hold of a record; return whether it is all there."""
    while written < size:
        if not 1 < number < len(pages.in_journal):
            return False
        place, data = pages.in_journal[number], pages.journal
        if place == 0:
            place, data = (number - 1) * pages.page_size, pages.file
        if place + pages.page_size > len(data):
            return False
        count = min(size - written, pages.usable - 4)
        for byte in range(count):
            walk.long_record[written + byte] = data[place + 4 + byte]
        written += count
        number = big_endian(data, place, 4)
    return True


@jit_no_alloc
def find_frames(pages: Pages, is_big_endian: bool) -> bool:
    """Note where the journal has pages, up to its last commit; return whether all of their numbers can be.

    As SQLite does, it takes frames as long as they have the checksum of all before them.
    """
    journal, commit, first, second = pages.journal, FILE_HEADER, np.uint32(0), np.uint32(0)
    first, second = _sum_words(journal, 0, FILE_HEADER - 8, first, second, is_big_endian)
    if not _has_sums(journal, FILE_HEADER - 8, first, second):
        return True  # it begins anew: nothing in it is valid
    size = FRAME_HEADER + pages.page_size
    for begin in range(FILE_HEADER, len(journal) - size + 1, size):
        first, second = _sum_words(journal, begin, 8, first, second, is_big_endian)
        first, second = _sum_words(journal, begin + FRAME_HEADER, pages.page_size, first, second, is_big_endian)
        same_salt = big_endian(journal, begin + 8, 4) == big_endian(journal, 16, 4)
        same_salt &= big_endian(journal, begin + 12, 4) == big_endian(journal, 20, 4)
        if not same_salt or not _has_sums(journal, begin + 16, first, second):
            break
        if big_endian(journal, begin + 4, 4) > 0:
            commit = begin + size
    for begin in range(FILE_HEADER, commit, size):
        number = big_endian(journal, begin, 4)
        if number >= len(pages.in_journal):
            return False
        pages.in_journal[number] = begin + FRAME_HEADER
    return True


@jit_inline
def _sum_words(
    data: ByteArray, begin: int, count: int, first: np.uint32, second: np.uint32, is_big_endian: bool
) -> tuple[np.uint32, np.uint32]:
    for place in range(begin, begin + count, 8):
        first = np.uint32(first + _word(data, place, is_big_endian) + second)
        second = np.uint32(second + _word(data, place + 4, is_big_endian) + first)
    return first, second


@jit_inline
def _word(data: ByteArray, place: int, is_big_endian: bool) -> np.uint32:
    word = np.uint32(0)
    for byte in range(4):
        shift = np.uint32(24 - 8 * byte if is_big_endian else 8 * byte)
        word |= np.uint32(data[place + byte]) << shift
    return word


@jit_inline
def _has_sums(data: ByteArray, place: int, first: np.uint32, second: np.uint32) -> bool:
    return big_endian(data, place, 4) == np.int64(first) and big_endian(data, place + 4, 4) == np.int64(second)
