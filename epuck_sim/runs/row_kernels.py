"""Compiled code that compares a record of a SQLite file with its checksum, which it computes as `checksums` does.

The format of records: https://www.sqlite.org/fileformat2.html#record_format.
"""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.util.jit import jit_inline, jit_no_alloc

POLYNOMIAL = 0xEDB88320
"""Polynomial of zlib's CRC-32, with its lowest power first."""

NULL, FLOAT, ZERO, ONE, FIRST_BLOB = 0, 7, 8, 9, 12
"""Kinds of values in a record; 1 to 6 are whole numbers, even ones from `FIRST_BLOB` on blobs, odd ones text."""

LONGEST_NUMBER = 15
"""Bytes that a whole number of 64 bits takes at most as `marshal` writes it; a text takes 5 beside its own."""

MASK = np.uint32(0xFF)
BYTE = np.uint32(8)


class Columns(NamedTuple):
    """The columns of a table, in the order in which records have them."""

    summed: IntArray
    """Columns in the order in which they are summed."""
    is_real: BoolArray
    """Whether each is REAL: whole numbers in it are floats, stored in short."""
    checksum: int
    """The column that holds the checksum."""
    head: ByteArray
    """Bytes with which the summed text of each row begins."""


class Scratch(NamedTuple):
    """Memory for one record."""

    text: ByteArray
    """What is summed."""
    kinds: IntArray
    """(columns,) kind of each value."""
    begins: IntArray
    """(columns,) where each value begins."""
    real: FloatArray
    """(1,) a number."""
    bits: IntArray
    """(1,) the same memory as `real`."""


def make_scratch(columns: int, longest: int) -> Scratch:
    """Return memory for records of at most `columns` values and `longest` bytes."""
    real = np.zeros(1)
    per_column = np.zeros(columns, np.int64)
    text = np.zeros(longest + LONGEST_NUMBER * (columns + 1), np.uint8)
    return Scratch(text, per_column, per_column.copy(), real, real.view(np.int64))


def make_crc_tables() -> np.ndarray:
    """Return (8, 256) tables of CRC-32: what a byte contributes from where it stands among eight."""
    tables = np.zeros((8, 256), np.uint32)
    tables[0] = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        tables[0] = (tables[0] >> np.uint32(1)) ^ np.where(tables[0] & np.uint32(1), np.uint32(POLYNOMIAL), 0)
    for place in range(1, 8):
        tables[place] = (tables[place - 1] >> BYTE) ^ tables[0][tables[place - 1] & MASK]
    return tables


CRC_TABLES = make_crc_tables()


@jit_inline
def big_endian(data: ByteArray, begin: int, count: int) -> int:
    """Return a number without sign of up to 7 bytes."""
    number = np.int64(0)
    for place in range(begin, begin + count):
        number = (number << 8) | np.int64(data[place])
    return int(number)


@jit_inline
def signed(data: ByteArray, begin: int, count: int) -> int:
    """Return a number with a sign, of 1 to 8 bytes."""
    number = np.int64(np.int8(data[begin]))
    for place in range(begin + 1, begin + count):
        number = (number << 8) | np.int64(data[place])
    return int(number)


@jit_inline
def read_varint(data: ByteArray, begin: int, end: int) -> tuple[int, int]:
    """Return a number of up to 4 bytes of 7 bits, and where it ends; -1 for a longer one, which no length here is."""
    number = np.int64(0)
    for place in range(begin, min(begin + 4, end)):
        number = (number << 7) | np.int64(data[place] & 0x7F)
        if data[place] < 0x80:
            return int(number), place + 1
    return -1, begin


@jit_inline
def size_of(kind: int) -> int:
    """Return how many bytes a value of a kind takes."""
    if kind >= FIRST_BLOB:
        return (kind - FIRST_BLOB) >> 1
    if kind <= 4:
        return kind
    return 6 if kind == 5 else 0 if kind >= ZERO else 8


@jit_inline
def put_little_endian(text: ByteArray, end: int, number: int, count: int) -> int:
    """Append the lowest `count` bytes of a number; return where it ends."""
    for place in range(count):
        text[end + place] = np.uint8((number >> (8 * place)) & 0xFF)
    return end + count


@jit_inline
def put_whole_number(text: ByteArray, end: int, number: int) -> int:
    """Append a whole number as `marshal` writes it; return where it ends."""
    if -(1 << 31) <= number < 1 << 31:
        text[end] = ord("i")
        return put_little_endian(text, end + 1, number, 4)
    text[end] = ord("l")
    rest, digits, first = np.uint64(-number if number < 0 else number), 0, end + 5
    while rest > 0:
        put_little_endian(text, first + 2 * digits, int(rest & np.uint64(0x7FFF)), 2)
        rest >>= np.uint64(15)
        digits += 1
    put_little_endian(text, end + 1, -digits if number < 0 else digits, 4)
    return first + 2 * digits


@jit_no_alloc
def put_value(scratch: Scratch, end: int, data: ByteArray, begin: int, kind: int, is_real: bool) -> int:
    """Append a value of a record as `marshal` writes it; return where it ends, -1 for a float that is not finite."""
    text = scratch.text
    if kind == NULL:
        text[end] = ord("N")
        return end + 1
    size = size_of(kind)
    if kind >= FIRST_BLOB:
        text[end] = ord("u") if kind & 1 else ord("s")
        end = put_little_endian(text, end + 1, size, 4)
        for place in range(size):
            text[end + place] = data[begin + place]
        return end + size
    number = kind - ZERO if kind >= ZERO else signed(data, begin, size)
    if kind != FLOAT and not is_real:
        return put_whole_number(text, end, number)
    if kind == FLOAT and (number >> 52) & 0x7FF == 0x7FF:
        return -1
    if kind != FLOAT:
        scratch.real[0] = float(number)
        number = int(scratch.bits[0])
    text[end] = ord("g")
    return put_little_endian(text, end + 1, number, 8)


@jit_no_alloc
def crc32(text: ByteArray, end: int) -> int:
    """Return zlib's CRC-32 of the first bytes of a text."""
    crc, place = np.uint32(0xFFFFFFFF), 0
    while place + 8 <= end:
        low = crc ^ (
            np.uint32(text[place])
            | (np.uint32(text[place + 1]) << BYTE)
            | (np.uint32(text[place + 2]) << np.uint32(16))
            | (np.uint32(text[place + 3]) << np.uint32(24))
        )
        crc = (
            CRC_TABLES[7, low & MASK]
            ^ CRC_TABLES[6, (low >> BYTE) & MASK]
            ^ CRC_TABLES[5, (low >> np.uint32(16)) & MASK]
            ^ CRC_TABLES[4, low >> np.uint32(24)]
            ^ CRC_TABLES[3, text[place + 4]]
            ^ CRC_TABLES[2, text[place + 5]]
            ^ CRC_TABLES[1, text[place + 6]]
            ^ CRC_TABLES[0, text[place + 7]]
        )
        place += 8
    for rest in range(place, end):
        crc = (crc >> BYTE) ^ CRC_TABLES[0, (crc ^ np.uint32(text[rest])) & MASK]
    return int(crc ^ np.uint32(0xFFFFFFFF))


@jit_no_alloc
def has_checksum(data: ByteArray, begin: int, end: int, columns: Columns, scratch: Scratch) -> bool:
    """Return whether the record in these bytes has the checksum of its other values; False if it is not understood."""
    if not _find_values(data, begin, end, scratch):
        return False
    written = len(columns.head)
    for place in range(written):
        scratch.text[place] = columns.head[place]
    for column in columns.summed:
        kind, value = scratch.kinds[column], scratch.begins[column]
        written = put_value(scratch, written, data, value, kind, columns.is_real[column])
        if written < 0:
            return False
    kind, value = scratch.kinds[columns.checksum], scratch.begins[columns.checksum]
    if kind in (NULL, FLOAT) or kind > ONE:
        return False
    stored = kind - ZERO if kind >= ZERO else signed(data, value, size_of(kind))
    return stored == crc32(scratch.text, written)


@jit_no_alloc
def _find_values(data: ByteArray, begin: int, end: int, scratch: Scratch) -> bool:
    """Note kind and place of each value of a record; return whether they fill it, and are as many as columns."""
    header, place = read_varint(data, begin, end)
    column, values = 0, begin + header
    value = values
    while place < values <= end:
        kind, place = read_varint(data, place, values)
        if kind < 0 or ONE < kind < FIRST_BLOB or column == len(scratch.kinds):
            return False
        scratch.kinds[column], scratch.begins[column] = kind, value
        value += size_of(kind)
        column += 1
    return place == values and value == end and column == len(scratch.kinds)
