# %% [markdown]
# # PPO and distillation
#
# Two ways to a learned policy for the same task: PPO tries actions and follows what they return; distillation asks a
# teacher who knows the true car, and keeps what can be told from the drive. Both with a small budget here, on cars that
# differ, and in the benchmark beside the controller that both have to beat.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import lanekeep_agents
import lanekeep_benchmarks
from lanekeep_agents.distil.run import Distillation, settings_for

# %% [markdown]
# ## PPO
#
# The settings are those of the id (`lanekeep train ppo LaneKeep-v0`), but for fewer steps, and cars whose mass, tyres
# and actuator differ. A run is tried on held-out episodes as it goes, and the best policy is kept:

# %%
ppo = lanekeep_agents.train(
    "ppo",
    "lanekeep/LaneKeep-v0",
    "ppo",
    seed=0,
    steps=500_000,
    overwrite=True,
    env={"preview": 20, "action": "steering_rate", "tyre": "magic_formula", "randomisation": "mismatch"},
)
evaluations = pd.read_csv("ppo/evaluations.csv")
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
left.plot(evaluations["steps"], evaluations["mean_return"], marker=".")
left.set(xlabel="steps", ylabel="return", title="on held-out episodes")
right.plot(evaluations["steps"], 100 * evaluations["failure_rate"], marker=".")
right.set(xlabel="steps", ylabel="failed [%]")
plt.show()

# %% [markdown]
# ## Distillation
#
# A mix says which cars the teacher shows. The student is `lq-preview-offset-free` and a bounded correction, which
# listens to what it identifies while it drives: how the road wheel answers, how much the car understeers. Its weights
# are least squares, so that minutes are seconds, and nothing is tried out.

# %%
Path("mix.toml").write_text("""
base = "lq-preview-offset-free"
beside = ["lq-preview"]
bound = 0.15
fade = 8.0
rounds = 2

[common.keywords]
road = { kind = "random", seed = 0 }
preview = 20
departure = "cost"

[[set]]
name = "lag"
episodes = 32
keywords = { randomisation = { steering_lag = [0.8, 2.2] } }

[[set]]
name = "mismatch"
episodes = 32
keywords = { tyre = "magic_formula", randomisation = "mismatch" }
""")
student = Distillation(settings_for("LaneKeep-v0", 0, "mix.toml"), Path("student"), overwrite=True).run()
scores = student.record.training.scores
print(f"held-out cost: {100 * scores['held_out_cost_over_base']:.1f} % of the base controller's")

# %% [markdown]
# ## In the benchmark
#
# Three situations of the suite `learned`, whose roads neither has seen: the nominal car, an actuator with twice the
# lag, and cars that differ in everything.

# %%
Path("suite.toml").write_text("""
name = "two-ways"
description = "learned in two ways"
episodes = 64

[common.keywords]
road = { kind = "random", seed = 1 }
preview = 20
departure = "cost"

[[scenario]]
name = "nominal"
title = "the nominal car"

[[scenario]]
name = "lag"
title = "twice the actuator's lag"
keywords = { randomisation = { steering_lag = 2.0 } }

[[scenario]]
name = "mismatch"
title = "cars that differ"
keywords = { tyre = "magic_formula", randomisation = "mismatch" }
""")
policies = {
    "yin-lqr-feedforward": "yin-lqr-feedforward",
    "lq-preview-offset-free": "lq-preview-offset-free",
    "PPO": "ppo/ppo-lane-keep-seed0.json",
    "distilled": "student/distilled-lane-keep-seed0.json",
}
summary = lanekeep_benchmarks.benchmark("suite.toml", list(policies.values()), out="compared", overwrite=True)

figure, panels = plt.subplots(1, 3, figsize=(10, 3), layout="constrained", sharey=True)
for panel, scenario in zip(panels, summary["scenarios"], strict=True):
    for place, row in enumerate(scenario["policies"]):
        found = row["metrics"]["return"]
        panel.plot([-found["low"], -found["high"]], [place, place], color="0.5")
        panel.plot(-found["value"], place, "o")
    panel.set(title=scenario["title"], xlabel="cost (minus return), 95 % interval", xscale="log")
panels[0].set_yticks(range(len(policies)), list(policies))
plt.show()

rows = {
    label: {
        scenario["title"]: f"{row['metrics']['return']['value']:.2f}"
        for scenario in summary["scenarios"]
        for row in scenario["policies"]
        if row["policy"] == name
    }
    for label, name in policies.items()
}
pd.DataFrame(rows).T

# %% [markdown]
# PPO's policy has no memory: it cannot tell a slow actuator from a quick one, and drives all of them alike. What the
# student does better than its base is what it has identified. `lanekeep train` with the full steps and `lanekeep
# distil` with the full mix take minutes; [learned policies](../learned-policies.md) shows what they reach.
