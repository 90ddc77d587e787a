"""What an observation shows: each channel says which row of the lanes it comes from."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.physics.numeric import clip


@helper
def gather(first, last, lanes, settings, observation):
    """Write the channels that are rows of the lanes, inside their bounds; others are left as they are."""
    for channel in range(observation.shape[1]):
        place = at.CHANNELS + at.CHANNEL_SIZE * channel
        low, high, source = settings[place], settings[place + 1], np.int64(settings[place + 2])
        if source >= 0:
            row = lanes[source]
            for i in range(first, last):
                observation[i, channel] = clip(row[i], low, high)
