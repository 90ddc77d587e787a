"""Stable-Baselines3's PPO with the same loss in fewer operations, and a critic that no single error pulls far."""

from __future__ import annotations

import math
from typing import Any

import torch
from stable_baselines3 import PPO
from torch.nn.functional import huber_loss

#: Errors of the critic beyond this pull no more than this, in units of the scaled return.
LARGEST_ERROR = 1.0
_LOG_ROOT = 0.5 * math.log(2.0 * math.pi)


class LeanPPO(PPO):
    """PPO for boxes of actions and plain networks: what Stable-Baselines3 does, without distributions and statistics.

    Advantages are normalised over the whole rollout, and the critic's loss is Huber's.
    """

    def train(self) -> None:
        """Fit actor and critic to the rollout."""
        policy: Any = self.policy
        policy.set_training_mode(True)
        self._update_learning_rate(policy.optimizer)
        clip = self.clip_range(self._current_progress_remaining)  # type: ignore[operator]
        rollout = next(self.rollout_buffer.get(None))
        advantages = (rollout.advantages - rollout.advantages.mean()) / (rollout.advantages.std() + 1e-8)
        columns = (rollout.observations, rollout.actions, rollout.old_log_prob, advantages, rollout.returns)
        parameters = list(policy.parameters())
        for _ in range(self.n_epochs):
            order: Any = torch.randperm(len(advantages))
            for rows in order.split(self.batch_size):
                loss: Any = self._loss(clip, *(column[rows] for column in columns))
                policy.optimizer.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(parameters, self.max_grad_norm)
                policy.optimizer.step()
        self._n_updates += self.n_epochs
        self.logger.record("train/loss", loss.item())
        self.logger.record("train/std", policy.log_std.exp().mean().item())

    def _loss(
        self,
        clip: float,
        observations: torch.Tensor,
        actions: torch.Tensor,
        old: torch.Tensor,
        advantages: torch.Tensor,
        returns: torch.Tensor,
    ) -> torch.Tensor:
        policy: Any = self.policy
        networks = policy.mlp_extractor
        mean = policy.action_net(networks.policy_net(observations))
        values = policy.value_net(networks.value_net(observations))[:, 0]
        noise = (actions - mean) * torch.exp(-policy.log_std)
        spread = policy.log_std.sum()
        likelihood = -0.5 * (noise * noise).sum(dim=1) - spread - _LOG_ROOT * actions.shape[1]
        ratio = torch.exp(likelihood - old)
        gained = torch.min(advantages * ratio, advantages * ratio.clamp(1.0 - clip, 1.0 + clip)).mean()
        missed = 2.0 * self.vf_coef * huber_loss(values, returns, delta=LARGEST_ERROR)
        return missed - gained - self.ent_coef * spread
