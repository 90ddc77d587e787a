# %% [markdown]
# # Identification: from a drive to a controller
#
# A car's data sheet knows no cornering stiffness. A drive of a minute with a lively steering wheel does: here one is
# recorded, the car is found in it with intervals, and a controller is designed on what was found.

# %%
import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import lanekeep_baselines
import lanekeep_env
from lanekeep_baselines.identification import PARAMETERS, excited_drive, identify, vehicle_from_identification
from lanekeep_baselines.yin_design import YinModel

# %% [markdown]
# ## The drive
#
# The car is one that nobody has told us about: Yin's with 400 kg more and a softer rear axle. On a winding road, at 10
# to 25 m/s, somebody steers along it and wiggles. Sensors are noisy: speed, yaw rate, heading, position, steering
# wheel. Your own drive is `DrivenRun(step=0.01, speed=..., yaw_rate=..., command=...)`, or without a command the
# measured steering angle.

# %%
hidden = {"base": "yin", "mass": 1900.0, "yaw_inertia": 3400.0, "rear_cornering_stiffness": 90_000.0}
run = excited_drive(seed=0, vehicle=hidden)

figure, panels = plt.subplots(3, 1, sharex=True, figsize=(9, 5), layout="constrained")
seconds = run.step * np.arange(len(run.speed))
for panel, values, label in zip(
    panels,
    (run.speed, np.degrees(run.command), np.degrees(run.yaw_rate)),
    ("speed [m/s]", "steering asked for [°]", "yaw rate [°/s]"),
    strict=True,
):
    panel.plot(seconds, values, linewidth=0.8)
    panel.set(ylabel=label)
panels[-1].set(xlabel="time [s]", xlim=(0, 30))
plt.show()

# %% [markdown]
# ## What it tells
#
# The equations of sideslip and yaw rate have six coefficients, the steering actuator a lag. All are fitted so that the
# simulated drive is the measured one; the 95 % intervals come with the fit.

# %%
found = identify(run)
true = YinModel.of(gym.make("lanekeep/LaneKeep-v0", vehicle=hidden).unwrapped.scenario.vehicle)
rows = {}
for name in PARAMETERS:
    low, high = found.intervals[name]
    truth = 1.0 / true.actuator_rate if name == "lag" else getattr(true, name)
    rows[name] = {
        "found": f"{found.values[name]:.4g}",
        "from": f"{low:.4g}",
        "to": f"{high:.4g}",
        "true": f"{truth:.4g}",
        "inside": "yes" if low <= truth <= high else "no",
    }
pd.DataFrame(rows).T

# %% [markdown]
# On average one interval in twenty misses, and neighbours miss together: a11 and a21 are read from the same sideslip,
# which no sensor measures. A residual that is correlated with its neighbour would say that the model has a fault which
# is no noise (an unknown delay, tyres that saturate):

# %%
for name, value in found.residual_correlation.items():
    print(f"{name:10} residual {found.residual_rms[name]:.3g}, correlation of neighbours {value:+.3f}")

# %% [markdown]
# ## What it is good for
#
# Coefficients are ratios, so one mass sets the scale, and no gain depends on it. What else a car has (ratio and limits
# of the steering, its size) is the data sheet's. The same controller, designed on three cars, drives the true one
# through 64 episodes:

# %%
envs = gym.make_vec(
    "lanekeep/LaneKeep-v0",
    num_envs=64,
    vectorization_mode="vector_entry_point",
    vehicle=hidden,
    preview=1,
    departure="cost",
)
scenario = envs.unwrapped.scenario
sheet = lanekeep_env.LaneKeepScenario(vehicle="yin").vehicle
measured = vehicle_from_identification(found, mass=1500.0, base=sheet)
designs = {"the data sheet's car": sheet, "the identified car": measured, "the true car": scenario.vehicle}


def errors(vehicle):
    """RMS lateral error of each episode, m."""
    told = lanekeep_env.LaneKeepScenario(vehicle=vehicle, preview=1, departure="cost")
    policy = lanekeep_baselines.make("yin-lqr-feedforward", told)
    observation, _ = envs.reset(seed=0)
    state, start, squares = None, np.ones(64, dtype=bool), []
    for _ in range(scenario.episode_steps):
        action, state = policy.predict(observation, state, start)
        observation, _, _, _, info = envs.step(action)
        start = np.zeros(64, dtype=bool)
        squares.append(info["lateral_error"] ** 2)
    return np.sqrt(np.mean(squares, axis=0))


driven = {label: errors(vehicle) for label, vehicle in designs.items()}
figure, panel = plt.subplots(figsize=(7, 3.2), layout="constrained")
panel.boxplot(list(driven.values()), tick_labels=list(driven), orientation="horizontal", whis=(0, 100))
panel.set(xlabel="RMS lateral error of an episode [m]", title="yin-lqr-feedforward on the true car, designed on")
plt.show()
pd.DataFrame({label: {"mean [m]": round(values.mean(), 4)} for label, values in driven.items()}).T
