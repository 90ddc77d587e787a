# %% [markdown]
# # Safe RL: as little steering as the lane allows
#
# A reward that adds up comfort and safety needs a weight that nobody knows. Constrained RL asks otherwise: steer as
# little as you can, *while the car is outside of its lane for at most a given share of the time*. The environment tells
# both apart: `info["steering_rate"]` is what comfort asks for, `info["cost"]` is 1 outside the lane, and with
# `departure="cost"` an episode goes on there. The weight becomes a price (a Lagrange multiplier), which rises while the
# limit is exceeded and falls while it is kept.

# %%
import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import lanekeep_env

LIMIT = 0.005  # share of the time that may be outside
EPISODES, PAIRS, ROUNDS = 64, 8, 80

# %% [markdown]
# ## The policy
#
# Few weights are enough to see what happens: those of the lateral error over the speed, of the heading error, and of
# the steering angle that the bends of the next two seconds take.

# %%
task = {"preview": 11, "preview_interval": 0.2, "departure": "cost", "episode_steps": 300, "dtype": "float32"}
envs = gym.make_vec(
    "lanekeep/LaneKeep-v0",
    num_envs=2 * PAIRS * EPISODES,
    vectorization_mode="vector_entry_point",
    autoreset_mode="disabled",
    **task,
)
scenario = envs.unwrapped.scenario
place = {channel.name: index for index, channel in enumerate(scenario.channels)}
bends = [place[f"curvature_preview_{index}"] for index in range(0, 11, 2)]
car = scenario.vehicle
axles = car.cg_to_rear_axle / car.front_cornering_stiffness - car.cg_to_front_axle / car.rear_cornering_stiffness
understeer = car.mass * axles / car.wheelbase

START = np.array([-1.0, -0.6, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # a controller that keeps the lane
WIDTH = np.array([0.2, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])  # how far around it a round looks


def action(observation, weights):
    """Actions (cars, 1) of weights (cars, 8)."""
    speed = observation[:, place["speed"]]
    steady = observation[:, bends] * (car.wheelbase + understeer * speed**2)[:, None]
    seen = np.column_stack(
        [observation[:, place["lateral_error"]] / speed, observation[:, place["heading_error"]], steady]
    )
    angle = np.einsum("ij,ij->i", seen, weights)
    return (angle / scenario.max_steering_angle)[:, None].astype(np.float32)


def drive(weights, first):
    """Effort of the steering and share of the time outside, of each row of weights, over the same episodes."""
    rows = np.repeat(weights, EPISODES, axis=0)
    observation, _ = envs.reset(seed=[first + episode for _ in weights for episode in range(EPISODES)])
    effort = outside = np.zeros(len(rows))
    for _ in range(scenario.episode_steps):
        observation, _, _, _, info = envs.step(action(observation, rows))
        effort = effort + (info["steering_rate"] / 0.1) ** 2
        outside = outside + info["cost"]
    shape = len(weights), EPISODES
    return tuple(total.reshape(shape).mean(axis=1) / scenario.episode_steps for total in (effort, outside))


# %% [markdown]
# ## Learning
#
# Random search: a round drives pairs of weights on both sides of the present ones through the same episodes, and goes
# where effort plus price times cost is smaller. Then the price follows. Without a price the same search is blind to the
# lane.


# %%
def learn(raise_price):
    """The weights, and what happened, a row a round."""
    random, weights, price, rows = np.random.default_rng(0), START.copy(), 0.0, []
    for number in range(ROUNDS):
        steps = random.standard_normal((PAIRS, len(START)))
        effort, outside = drive(np.concatenate([weights + WIDTH * steps, weights - WIDTH * steps]), 1000 * number)
        rows.append((effort.mean(), outside.mean(), price))
        paid = effort + price * outside
        slope = (paid[:PAIRS] - paid[PAIRS:]) @ steps / (PAIRS * paid.std())
        weights -= 0.3 * WIDTH * slope
        price = max(0.0, price + raise_price * (outside.mean() - LIMIT))
    return weights, pd.DataFrame(rows, columns=["effort", "outside", "price"])


runs = {"without a price": learn(0.0), "with a price": learn(0.5)}

figure, panels = plt.subplots(1, 3, figsize=(11, 3), layout="constrained")
for label, (_, rows) in runs.items():
    panels[0].plot(rows["effort"], label=label)
    panels[1].plot(100 * rows["outside"])
    panels[2].plot(rows["price"])
panels[0].set(xlabel="round", title="effort of the steering", yscale="log")
panels[0].legend()
panels[1].set(xlabel="round", title="time outside the lane [%]")
panels[1].axhline(100 * LIMIT, color="0.5", linestyle=":")
panels[2].set(xlabel="round", title="price")
plt.show()

# %% [markdown]
# ## What was learned
#
# On episodes that no round has seen:

# %%
candidates = {"the start": START} | {label: weights for label, (weights, _) in runs.items()}
filled = np.array([*candidates.values()] + [START] * (2 * PAIRS - len(candidates)))
effort, outside = drive(filled, 10_000_000)
pd.DataFrame(
    {
        label: {
            "effort of the steering": f"{effort[row]:.4f}",
            "time outside the lane [%]": f"{100 * outside[row]:.2f}",
        }
        for row, label in enumerate(candidates)
    }
).T

# %%
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(9, 5), layout="constrained")
rows = np.repeat(filled, EPISODES, axis=0)
observation, _ = envs.reset(seed=[10_000_000 + episode for _ in filled for episode in range(EPISODES)])
seen = []
for _ in range(scenario.episode_steps):
    observation, _, _, _, info = envs.step(action(observation, rows))
    seen.append((info["lateral_error"], observation[:, place["steering_angle"]]))
lateral, angle = np.array(seen).transpose(1, 0, 2)
seconds = scenario.control_step * np.arange(scenario.episode_steps)
for row, label in enumerate(candidates):
    above.plot(seconds, lateral[:, row * EPISODES], label=label)
    below.plot(seconds, np.degrees(angle[:, row * EPISODES]))
above.axhspan(-scenario.lane_width / 2, scenario.lane_width / 2, color="0.5", alpha=0.15)
above.set(ylabel="lateral error [m]", ylim=(-4, 4))
above.legend(loc="upper right")
below.set(xlabel="time [s]", ylabel="road wheel [°]")
plt.show()

# %% [markdown]
# With a price the car uses the width of the lane and steers more gently; without one it leaves it. What the curves show
# are the neighbours that a round tries, some of which are bolder than what is kept. The price at the end is what a
# share of the time outside is worth in effort: the weight that nobody knew. Learners of Stable-Baselines3 meet the same
# numbers as `lanekeep_agents.sb3_vec_env(...).truth["cost"]` ([train](../train.md)), and a stricter limit needs more
# episodes, since what is rare has to be seen.
