"""Observations as the networks see them: of mean zero and variance one, but for what hardly varies in training."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize

#: Least standard deviation of a channel, as a share of its mean.
LEAST = 0.01


class Normalised(VecNormalize):
    """`VecNormalize` of observations that takes no channel for more constant than to `LEAST` of its mean.

    A speed that is the same in all of training has no variance; divided by it, a millimetre per second elsewhere would
    drown every other channel.
    """

    def __init__(self, venv: Any) -> None:
        super().__init__(venv, norm_reward=False, clip_obs=10.0, epsilon=1e-8)

    @staticmethod
    def variance(statistics: RunningMeanStd) -> NDArray[np.float64]:
        """Return what stands for the variance of each channel, (channels,)."""
        return np.maximum(statistics.var, (LEAST * statistics.mean) ** 2)

    def _normalize_obs(self, obs: NDArray[Any], obs_rms: RunningMeanStd) -> NDArray[Any]:
        scaled = (obs - obs_rms.mean) / np.sqrt(self.variance(obs_rms) + self.epsilon)
        return np.clip(scaled, -self.clip_obs, self.clip_obs)
