"""Statistical tests of whether samples follow a distribution."""

import math

import numpy as np
from scipy import stats

UNLIKELY = 1e-4
"""Seeds are fixed: chance fails no test; what is wrong gives far less than this."""


def fits(observed, expected):
    """Whether counts are those of a distribution with these shares, by a chi-square test."""
    shares = np.asarray(expected) / np.sum(expected)
    assert (shares * np.sum(observed)).min() > 20
    return stats.chisquare(np.ravel(observed), np.ravel(shares * np.sum(observed))).pvalue > UNLIKELY


def is_uniform(values, low, high):
    return stats.kstest(np.ravel(values), "uniform", args=(low, high - low)).pvalue > UNLIKELY


def is_anywhere(headings):
    """Whether (agents, dimensions) headings are uniform over all directions."""
    if headings.shape[1] == 1:
        return set(headings.ravel()) == {-1.0, 1.0} and fits(np.unique(headings, return_counts=True)[1], [1, 1])
    if headings.shape[1] == 2:
        return is_uniform(np.arctan2(headings[:, 1], headings[:, 0]), -math.pi, math.pi)
    azimuth = np.arctan2(headings[:, 1], headings[:, 0])
    return is_uniform(headings[:, 2], -1, 1) and is_uniform(azimuth, -math.pi, math.pi)
