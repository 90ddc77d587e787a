"""Sensors with faults, in the kernel: the measured channels of one car, and what they remember."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import clip, library, like, sqrt
from lanekeep_env.randomness import derive, uniform

# A car's draws of one control step live under a key of their own; numbers of the draws of one sensor (a normal number
# takes two):
NOISE, DROPPED, JUMPS, JUMP_SIZE = np.int64(0), np.int64(2), np.int64(3), np.int64(4)
DRAWS = np.int64(8)  # a sensor
#: Counter of the first key of a step; far above the draws of an episode's start.
FIRST_STEP = np.int64(1 << 32)
#: Rows of one sensor: value held, whether its sample saw anything, offset by jumps, bias; then the
#: truth, newest first.
HELD, SEEN, OFFSET, BIAS, TRUTH = 0, 1, 2, 3, 4


@inline
def normal(key, counter):
    """Standard normal number (Box-Muller) from the draws ``counter`` and the next."""
    first, second = uniform(key, counter), uniform(key, counter + np.int64(1))
    radius = sqrt(-2.0 * library(first).log(1.0 - first))
    return radius * library(second).cos(6.283185307179586 * second)


@helper
def measure(i, block, counters, settings, sensors, observation):
    """Replace the measured channels of car i by what its sensors give, and write their new-sample channels.

    A truth of NaN is one that the sensor cannot see: the last sample is held, and a validity channel tells so, or a
    number is shown that stands for it.
    """
    episode = derive(np.uint64(counters[at.KEY, i]), counters[at.EPISODE, i])
    step = np.int64(block[at.STEP, i])
    key = derive(episode, FIRST_STEP + step)
    first = derive(episode, FIRST_STEP)
    row = at.CAR_ROWS + np.int64(settings[at.DELAY_DEPTH])
    flag = observation.shape[1]
    for channel in range(sensors.shape[0]):
        if sensors[channel, 3] > 1.0 or sensors[channel, 5] > 0.0:
            flag -= 1
    for channel in range(sensors.shape[0]):
        noise, bias, resolution = sensors[channel, 0], sensors[channel, 1], sensors[channel, 2]
        period, delay = np.int64(sensors[channel, 3]), np.int64(sensors[channel, 4])
        dropout, jump, jumps = sensors[channel, 5], sensors[channel, 6], sensors[channel, 7]
        column, valid = np.int64(sensors[channel, at.COLUMN]), np.int64(sensors[channel, at.VALID_COLUMN])
        truth = block[np.int64(sensors[channel, at.SOURCE]), i]
        draw = np.int64(channel) * DRAWS
        if step == 0:
            block[row + HELD, i] = sensors[channel, at.MISSING] if np.isnan(truth) else truth
            block[row + SEEN, i] = like(truth, 0.0)
            block[row + OFFSET, i] = like(truth, 0.0)
            block[row + BIAS, i] = bias * normal(first, draw + JUMP_SIZE + np.int64(1))
            for k in range(delay + 1):
                block[row + TRUTH + k, i] = truth
        else:
            for k in range(delay, 0, -1):
                block[row + TRUTH + k, i] = block[row + TRUTH + k - 1, i]
            block[row + TRUTH, i] = truth
        if jump > 0.0 and uniform(key, draw + JUMPS) < jumps:
            block[row + OFFSET, i] = jump * (2.0 * uniform(key, draw + JUMP_SIZE) - 1.0)
        sampled = step == 0 or (step % period == 0 and (dropout == 0.0 or uniform(key, draw + DROPPED) >= dropout))
        if sampled:
            seen = block[row + TRUTH + delay, i]
            value = np.float64(seen) + block[row + BIAS, i] + block[row + OFFSET, i]
            if noise > 0.0:
                value += noise * normal(key, draw + NOISE)
            if resolution > 0.0:
                value = resolution * np.floor(value / resolution + 0.5)
            block[row + SEEN, i] = 0.0 if np.isnan(seen) else 1.0
            missing = block[row + HELD, i] if sensors[channel, at.HOLDS] > 0.0 else sensors[channel, at.MISSING]
            block[row + HELD, i] = missing if np.isnan(seen) else value
        place = at.CHANNELS + 2 * column
        observation[i, column] = clip(block[row + HELD, i], settings[place], settings[place + 1])
        if valid >= 0:
            observation[i, valid] = block[row + SEEN, i]
        if period > 1 or dropout > 0.0:
            observation[i, flag] = 1.0 if sampled else 0.0
            flag += 1
        row += TRUTH + 1 + delay
