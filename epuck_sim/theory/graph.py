"""Measures of the graph of who hears whom: means over snapshots of a swarm, and shares of snapshots, with intervals."""

import math
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.estimate import Estimate
from epuck_sim.statistics.statistic import QUANTILE, wilson_interval


class GraphMeasures(NamedTuple):
    """What the snapshots of a swarm have in common."""

    links: Estimate  # links an agent: to how many others its pulse goes
    reciprocity: Estimate  # share of links whose receiver has a link back; NaN without links
    components: Estimate  # number of strongly connected components over that of agents
    sources: Estimate  # share of agents that are heard and hear nobody
    frustrated: Estimate
    """Probability of two or more components without a way in: clusters that nothing brings together (Beardo et al.)."""
    joined: Estimate  # probability that one component reaches all others, so that a swarm that stands can synchronise


def measure_graphs(snapshots: BoolArray) -> GraphMeasures:
    """Return the measures of snapshots, (snapshots, population, population): sender, receiver.

    >>> ring = np.roll(np.eye(4, dtype=bool), 1, axis=1)
    >>> measured = measure_graphs(np.array([ring, ring]))
    >>> measured.links.value, measured.reciprocity.value, measured.joined.value
    (1.0, 0.0, 1.0)
    """
    out, into = snapshots.any(2), snapshots.any(1)
    links = snapshots.sum((1, 2))
    back = (snapshots & snapshots.transpose(0, 2, 1)).sum((1, 2))
    components, without_way_in = count_components(snapshots)
    population = snapshots.shape[1]
    return GraphMeasures(
        links=mean(links / population),
        reciprocity=mean(back[links > 0] / links[links > 0]),
        components=mean(components / population),
        sources=mean((out & ~into).mean(1)),
        frustrated=share(without_way_in > 1),
        joined=share(without_way_in == 1),
    )


def count_components(snapshots: BoolArray) -> tuple[IntArray, IntArray]:
    """Return (snapshots,) number of strongly connected components, and of those of them without a way in."""
    count, population, _ = snapshots.shape
    which, sender, receiver = np.nonzero(snapshots)
    ends = which * population + sender, which * population + receiver
    size = count * population
    graph = coo_array((np.ones(len(which), np.int8), ends), shape=(size, size))
    found, component = connected_components(graph, directed=True, connection="strong")
    has_way_in = np.zeros(found, np.bool_)
    one, other = component[ends[0]], component[ends[1]]
    has_way_in[other[one != other]] = True
    snapshot_of = np.zeros(found, np.int64)
    snapshot_of[component] = np.arange(size) // population
    return np.bincount(snapshot_of, minlength=count), np.bincount(snapshot_of[~has_way_in], minlength=count)


def mean(values: FloatArray) -> Estimate:
    """Return the mean of independent values with its 95 % interval."""
    if len(values) < 2:
        return Estimate(float(values.mean()) if len(values) else math.nan)
    value, reach = float(values.mean()), QUANTILE * float(values.std(ddof=1)) / math.sqrt(len(values))
    return Estimate(value, value - reach, value + reach)


def share(true: BoolArray) -> Estimate:
    """Return the share of what is true with Wilson's 95 % interval."""
    value = float(true.mean())
    return Estimate(value, *wilson_interval(value, len(true)))
