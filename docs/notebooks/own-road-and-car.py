# %% [markdown]
# # Your own road and car
#
# A road is a file with its centre line, a car is a handful of numbers. Here both are made, checked and driven, and the
# picture shows where on the road a heavier car goes wrong, whose controller was designed for the lighter one.

# %%
from pathlib import Path

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import lanekeep_baselines
import lanekeep_env
from lanekeep_env.roads import read_road

# %% [markdown]
# ## A road
#
# Points of a centre line, x and y in m, a metre or some metres apart; here a closed one with bends of both directions.
# From a GPS logger, OpenStreetMap, OpenDRIVE or CommonRoad the file is one of those formats instead.

# %%
angle = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
radius = 260.0 + 60.0 * np.cos(3.0 * angle)
points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
np.savetxt("my_road.csv", points, delimiter=",", header="x_m,y_m", comments="")

road = read_road("my_road.csv")
print(f"{road.length:.0f} m, closed: {road.closed}, narrowest bend {1.0 / road.peak_curvature:.0f} m,", end=" ")
print(f"at most {1000 * road.fit_error:.1f} mm beside the points")

# %% [markdown]
# `lanekeep road check my_road.csv --out my_road.png` says the same and draws it. Points that scatter are smoothed, with
# a warning that says by how much; what cannot be read rightly is refused with a way out.
#
# ## A car
#
# Numbers in a YAML file, with units or in SI; what is left out is that of `base`.

# %%
Path("my_car.yaml").write_text("""
base: yin
mass: 2.1 t
yaw_inertia: 4000
rear_cornering_stiffness: 95 kN/rad
steering: {lag: 0.12, rate_limit: 0.5}
""")


def make(**keywords):
    """One lap with the road shown 2 s ahead; leaving the lane is charged and ends nothing."""
    return gym.make(
        "lanekeep/LaneKeep-v0", road="my_road.csv", preview=20, episode_steps="lap", departure="cost", **keywords
    )


light, heavy = make(), make(vehicle="my_car.yaml")
cars = {"Yin's": light.unwrapped.scenario.vehicle, "mine": heavy.unwrapped.scenario.vehicle}
names = ("mass", "yaw_inertia", "wheelbase", "front_cornering_stiffness", "rear_cornering_stiffness")
pd.DataFrame({name: {label: getattr(car, name) for label, car in cars.items()} for name in names}).T

# %% [markdown]
# ## A lap
#
# One controller, three ways: the light car with its own design, the heavy car with the light one's, the heavy car with
# its own. The design is what `make` of a controller takes from the scenario, so that it may be another one than the
# environment's.


# %%
def lap(env, policy):
    """Arc length (m), lateral error (m), and whether the lane was kept."""
    observation, info = env.reset(seed=0, options={"arc_length": 0.0, "lateral_error": 0.0})
    state, rows, over = None, [], False
    while not over:
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        rows.append((info["arc_length"], info["lateral_error"]))
        over = terminated or truncated
    return np.array(rows).T, info["is_success"]


def design(env):
    return lanekeep_baselines.make("yin-lqr-feedforward", env.unwrapped.scenario)


laps = {
    "the light car, its own design": lap(light, design(light)),
    "the heavy car, the light one's design": lap(heavy, design(light)),
    "the heavy car, its own design": lap(heavy, design(heavy)),
}
pd.DataFrame(
    {
        label: {
            "lane kept": "yes" if kept else "no",
            "RMS lateral error [m]": f"{np.sqrt(np.mean(error**2)):.3f}",
            "peak [m]": f"{np.abs(error).max():.3f}",
        }
        for label, ((_, error), kept) in laps.items()
    }
).T

# %%
figure, panels = plt.subplots(1, 3, figsize=(11, 4.2), layout="constrained")
largest = max(np.abs(error).max() for (_, error), _ in laps.values())
for panel, (label, ((along, error), _)) in zip(panels, laps.items(), strict=True):
    x, y = road.position(along % road.length).T
    marks = panel.scatter(x, y, c=error, s=6, cmap="coolwarm", vmin=-largest, vmax=largest)
    panel.set(title=label, aspect="equal", xticks=[], yticks=[])
figure.colorbar(marks, ax=panels, label="lateral error [m], left of the lane's centre positive")
plt.show()

# %% [markdown]
# With the wrong design the heavy car is beside its lane's centre in every bend, always towards the same side of the
# bend: the angle that the bend takes is that of another car. Where a car's numbers are not known, they can be
# [identified](identification.md).
#
# In the benchmark the same road is `lanekeep bench --road my_road.csv`, and a suite's scenario takes the same keywords:
# `keywords = { road = "my_road.csv", vehicle = "my_car.yaml" }`.
