"""What an observation shows: each channel says which row it comes from."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.physics.numeric import clip


@helper
def gather(first, last, block, settings, observation):
    """Write the channels that are rows of the block, inside their bounds; others are left as they are."""
    table = at.CHANNELS + 2 * observation.shape[1]
    for place in range(table, table + 2 * np.int64(settings[at.GATHERED]), 2):
        channel, row = np.int64(settings[place]), block[np.int64(settings[place + 1])]
        low, high = settings[at.CHANNELS + 2 * channel], settings[at.CHANNELS + 2 * channel + 1]
        seen, told = row[first:last], observation[first:last, channel]
        for i in range(last - first):
            told[i] = clip(seen[i], low, high)
