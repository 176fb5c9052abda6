"""Selection of the smallest of some values, in ascending order, without a pass over all values for each of them.

If few are wanted, one pass finds the largest of these, and a second one all values up to it. If more are wanted, values
are sorted into buckets by size, and only those in the first buckets are compared. Squared distances of agents in a
square are nearly uniform, so that few share a bucket. The buckets are not inlined: that would slow the search for few.
"""

import math

from epuck_sim.arrays import FloatArray, IndexArray
from epuck_sim.util.jit import jit_inline, jit_no_alloc

FEW = 6  # largest number of wanted values for which a pass for their limit is faster than buckets

SAMPLED = 8
"""Every eighth value is sampled for the range that is divided into buckets; values above it go to the last bucket."""

SMALLEST_RANGE = 1e-300  # lower limit of the range of values that is divided into buckets; keeps its inverse finite


@jit_inline
def minimum(values: FloatArray, first: int, last: int) -> float:
    """Return the minimum of `values[first:last]`, inf if it is empty.

    Branch-free, here and below: the comparisons are unpredictable, so branches would be mispredicted. Four minima are
    kept side by side, because each comparison has to wait for the one before.
    """
    a = b = c = d = math.inf
    whole = last - (last - first) % 4
    for index in range(first, whole, 4):
        a = min(a, values[index])
        b = min(b, values[index + 1])
        c = min(c, values[index + 2])
        d = min(d, values[index + 3])
    for index in range(whole, last):
        a = min(a, values[index])
    return min(a, b, c, d)


@jit_inline
def select_smallest(
    values: FloatArray, count: int, wanted: int, bucket_of: IndexArray, bucket_end: IndexArray, found: IndexArray
) -> None:
    """Write the indices of the smallest values to `found`: ascending, equal values in the order of their indices.

    It selects `wanted` of the first `count` values, of which at most one is inf and none is negative. The buckets,
    (count,), are scratch; so is the rest of `found`, (count,).
    """
    if wanted > FEW:
        sort(found, values, fill_buckets(values, count, wanted, bucket_of, bucket_end, found))
        return
    limit, places = find_limit(values, count, wanted), 0
    for index in range(count):
        found[places] = index  # overwritten by the next one if this one is too large: no branch
        places += values[index] <= limit
    sort(found, values, places)


@jit_inline
def find_limit(values: FloatArray, count: int, wanted: int) -> float:
    """Return the largest of the `wanted` smallest of `values[:count]`; for up to 3, with fewer comparisons."""
    a = b = c = d = e = f = math.inf
    for index in range(count if wanted <= 3 else 0):
        value = values[index]
        a, value = min(a, value), max(a, value)
        b, value = min(b, value), max(b, value)
        c = min(c, value)
    for index in range(count if wanted > 3 else 0):
        value = values[index]
        a, value = min(a, value), max(a, value)
        b, value = min(b, value), max(b, value)
        c, value = min(c, value), max(c, value)
        d, value = min(d, value), max(d, value)
        e, value = min(e, value), max(e, value)
        f = min(f, value)
    return (a, b, c, d, e, f)[wanted - 1]


@jit_no_alloc
def fill_buckets(
    values: FloatArray, count: int, k: int, bucket_of: IndexArray, bucket_end: IndexArray, found: IndexArray
) -> int:
    """Write all indices to `found`, bucket by bucket; return how many are in the first buckets: at least k."""
    highest = 0.0
    for index in range(0, count, SAMPLED):
        highest = max(highest, values[index] if values[index] < math.inf else 0.0)
    for bucket in range(count):
        bucket_end[bucket] = 0
    per_unit = count / max(highest, SMALLEST_RANGE)
    for index in range(count):
        bucket = min(int(min(values[index], highest) * per_unit), count - 1)
        bucket_of[index] = bucket
        bucket_end[bucket] += 1
    total = 0
    selected: int = 0
    for bucket in range(count):  # from here on `bucket_end` is where the next value of each bucket goes
        size = bucket_end[bucket]
        bucket_end[bucket] = total
        total += size
        selected = total if selected < k else selected
    for index in range(count):
        bucket = bucket_of[index]
        found[bucket_end[bucket]] = index
        bucket_end[bucket] += 1
    return selected


@jit_no_alloc
def sort(found: IndexArray, values: FloatArray, count: int) -> None:
    """Sort indices, few or nearly sorted, by their values; equal values keep their order."""
    for last in range(1, count):
        index = found[last]
        value = values[index]
        place = last
        while place > 0 and values[found[place - 1]] > value:
            found[place] = found[place - 1]
            place -= 1
        found[place] = index


@jit_inline
def find_two_smallest(values: FloatArray, count: int) -> tuple[int, float, float]:
    """Return the index of the first minimum of `values[:count]`, the minimum, and the next value; inf without any."""
    a = b = c = d = (0, math.inf, math.inf)
    whole = count - count % 4
    for index in range(0, whole, 4):
        a = include(a, index, values[index])
        b = include(b, index + 1, values[index + 1])
        c = include(c, index + 2, values[index + 2])
        d = include(d, index + 3, values[index + 3])
    for index in range(whole, count):
        a = include(a, index, values[index])
    return merge(merge(a, b), merge(c, d))


@jit_inline
def include(smallest: tuple[int, float, float], index: int, value: float) -> tuple[int, float, float]:
    """Return the index of the minimum, the minimum and the next smallest value after one more value."""
    place, lowest, second = smallest
    return index if value < lowest else place, min(lowest, value), min(second, max(lowest, value))


@jit_inline
def merge(one: tuple[int, float, float], two: tuple[int, float, float]) -> tuple[int, float, float]:
    """Return the index of the minimum, the minimum and the next smallest value of two sets of values."""
    is_in_two = (two[1] < one[1]) | ((two[1] == one[1]) & (two[0] < one[0]))
    return two[0] if is_in_two else one[0], min(one[1], two[1]), min(one[2], two[2], max(one[1], two[1]))
