"""Counter-based random numbers: everything random in an episode is a hash of its key and a counter.

Nothing is consumed, so two policies on one key meet the same road, car and noise whatever they do,
and a car's episodes do not depend on its neighbours.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env.compile import inline


@inline
def mix(x):
    """SplitMix64's finaliser (Steele, Lea, Flood 2014): a bijection of uint64 that passes BigCrush in sequence."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@inline
def derive(key, counter):
    """Return the uint64 key that belongs to ``counter`` (an integer) under ``key`` (uint64)."""
    return mix(key + (np.uint64(counter) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15))


@inline
def uniform(key, counter):
    """Return a float64 in [0, 1) that belongs to ``counter`` under ``key``."""
    return np.float64(derive(key, counter) >> np.uint64(11)) * 1.1102230246251565e-16
