"""PPO with continuous actions on Gymnasium's vector environments, as research code has it.

It follows the structure of CleanRL's ppo_continuous_action.py (Huang et al., "CleanRL", JMLR 23, 2022; MIT licence) and
knows nothing of lanekeep.
"""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.distributions.normal import Normal


def layer_init(layer, std=2**0.5, bias=0.0):
    torch.nn.init.orthogonal_(layer.weight, std)
    torch.nn.init.constant_(layer.bias, bias)
    return layer


class Agent(nn.Module):
    def __init__(self, envs, log_std):
        super().__init__()
        inputs, actions = np.prod(envs.single_observation_space.shape), np.prod(envs.single_action_space.shape)

        def network(outputs, std):
            hidden = layer_init(nn.Linear(inputs, 64)), nn.Tanh(), layer_init(nn.Linear(64, 64)), nn.Tanh()
            return nn.Sequential(*hidden, layer_init(nn.Linear(64, outputs), std))

        self.critic, self.actor_mean = network(1, 1.0), network(actions, 0.01)
        self.actor_logstd = nn.Parameter(torch.full((1, actions), log_std))

    def get_value(self, x):
        return self.critic(x)

    def get_action_and_value(self, x, action=None):
        mean = self.actor_mean(x)
        probs = Normal(mean, torch.exp(self.actor_logstd.expand_as(mean)))
        if action is None:
            action = probs.sample()
        return action, probs.log_prob(action).sum(1), probs.entropy().sum(1), self.critic(x)


def make_envs(env_id, num_envs, gamma, vectorization_mode, **keywords):
    """The wrappers that CleanRL puts around each environment, here around all of them."""
    envs = gym.make_vec(env_id, num_envs, vectorization_mode=vectorization_mode, **keywords)
    envs = gym.wrappers.vector.RecordEpisodeStatistics(envs)
    envs = gym.wrappers.vector.ClipAction(envs)
    envs = gym.wrappers.vector.NormalizeObservation(envs)
    envs = gym.wrappers.vector.TransformObservation(envs, lambda obs: np.clip(obs, -10, 10), envs.observation_space)
    envs = gym.wrappers.vector.NormalizeReward(envs, gamma=gamma)
    return gym.wrappers.vector.TransformReward(envs, lambda reward: np.clip(reward, -10, 10))


def train(envs, updates, num_steps, seed=1, gamma=0.98, gae_lambda=0.95, log_std=-1.0, rate=3e-3, epochs=10, batches=8):
    """Return the agent and the returns of the episodes that ended in each update."""
    torch.manual_seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    agent = Agent(envs, log_std)
    optimizer = torch.optim.Adam(agent.parameters(), lr=rate, eps=1e-5)
    n = envs.num_envs
    obs = torch.zeros((num_steps, n, *envs.single_observation_space.shape))
    actions = torch.zeros((num_steps, n, *envs.single_action_space.shape))
    logprobs, rewards, dones, values = (torch.zeros((num_steps, n)) for _ in range(4))
    next_obs, next_done = torch.Tensor(envs.reset(seed=seed)[0]), torch.zeros(n)
    returns = []
    for update in range(updates):
        optimizer.param_groups[0]["lr"] = (1.0 - update / updates) * rate
        ended = []
        for step in range(num_steps):
            obs[step], dones[step] = next_obs, next_done
            with torch.no_grad():
                actions[step], logprobs[step], _, value = agent.get_action_and_value(next_obs)
            values[step] = value.flatten()
            found, reward, terminations, truncations, infos = envs.step(actions[step].numpy())
            rewards[step] = torch.tensor(reward)
            next_obs, next_done = torch.Tensor(found), torch.Tensor(terminations | truncations)
            if "episode" in infos:
                ended += infos["episode"]["r"][infos["_episode"]].tolist()
        returns.append(ended)

        with torch.no_grad():
            advantages, last = torch.zeros_like(rewards), torch.zeros(n)
            for t in reversed(range(num_steps)):
                alive = 1.0 - (next_done if t == num_steps - 1 else dones[t + 1])
                following = agent.get_value(next_obs).flatten() if t == num_steps - 1 else values[t + 1]
                delta = rewards[t] + gamma * following * alive - values[t]
                advantages[t] = last = delta + gamma * gae_lambda * alive * last
            targets = advantages + values

        b_obs, b_actions = obs.flatten(0, 1), actions.flatten(0, 1)
        b_logprobs, b_advantages, b_targets = logprobs.flatten(), advantages.flatten(), targets.flatten()
        for _ in range(epochs):
            for rows in torch.randperm(len(b_obs)).chunk(batches):
                _, logprob, entropy, value = agent.get_action_and_value(b_obs[rows], b_actions[rows])
                ratio = (logprob - b_logprobs[rows]).exp()
                advantage = b_advantages[rows]
                advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
                policy_loss = torch.max(-advantage * ratio, -advantage * ratio.clamp(0.8, 1.2)).mean()
                value_loss = 0.5 * ((value.flatten() - b_targets[rows]) ** 2).mean()
                optimizer.zero_grad()
                (policy_loss + 0.5 * value_loss - 0.0 * entropy.mean()).backward()
                nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
                optimizer.step()
    return agent, returns
