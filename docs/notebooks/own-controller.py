# %% [markdown]
# # Your own controller in the benchmark
#
# A controller says which channels it reads and answers with a road-wheel angle. Here a first attempt is compared with a
# published controller, its failures are looked at, and what they show is mended.

# %%
import matplotlib.pyplot as plt
import pandas as pd

import lanekeep_benchmarks
import lanekeep_env
from lanekeep_baselines import SteeringPolicy

# %% [markdown]
# ## A first attempt
#
# The car is left of its lane's centre: steer to the right; it points to the left: steer to the right as well. `at` has
# one array for each channel that the class reads, with a number for each car: hundreds of episodes are driven side by
# side.


# %%
class Feedback(SteeringPolicy):
    """A PD: the heading error is the rate of the lateral one over the speed."""

    name = "feedback"
    reads = ("lateral_error", "heading_error")

    def command(self, at, memory, fresh):
        return -0.05 * at["lateral_error"] - 0.6 * at["heading_error"], memory


summary = lanekeep_benchmarks.benchmark(
    "classical", ["yin-lqr-feedforward", Feedback], episodes=32, out="first", trace=True, overwrite=True
)


def table(summary):
    """Failure rate and RMS lateral error of each policy, a row a scenario."""
    rows = {
        (scenario["title"], row["policy"]): {
            "failed [%]": round(100 * row["failure_rate"]["value"], 1),
            "RMS lateral error [m]": round(row["metrics"]["rms_lateral_error"]["value"], 3),
        }
        for scenario in summary["scenarios"]
        for row in scenario["policies"]
    }
    return pd.DataFrame(rows).T.unstack()


table(summary)

# %% [markdown]
# ## What goes wrong
#
# Every step is kept (`trace=True`), and `read` returns it as a table. The episodes with the largest errors on random
# roads:

# %%
results, steps = lanekeep_benchmarks.read("first")
default = lanekeep_env.LaneKeepScenario()  # control step and lane are what the suite's roads have, too


def worst(results, steps, policy, count=3):
    """The steps of the episodes with the largest RMS lateral error on random roads."""
    mine = results[(results["scenario"] == "random-roads") & (results["policy"] == policy)]
    episodes = mine.nlargest(count, "rms_lateral_error")["episode"]
    there = (steps["scenario"] == "random-roads") & (steps["policy"] == policy)
    return {episode: steps[there & (steps["episode"] == episode)] for episode in episodes}


def draw(drives):
    """Lateral error, and below it the curvature of the road at the car, over time."""
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(9, 5), layout="constrained")
    for episode, drive in drives.items():
        seconds = default.control_step * drive["step"]
        above.plot(seconds, drive["lateral_error"], label=f"episode {episode}")
        below.plot(seconds, drive["observed.curvature_preview_0"])
    above.axhspan(-default.lane_width / 2, default.lane_width / 2, color="0.5", alpha=0.15, label="the lane")
    above.set(ylabel="lateral error [m]", ylim=(-4, 4))
    above.legend(loc="upper right")
    below.set(xlabel="time [s]", ylabel="curvature [1/m]")
    return figure


draw(worst(results, steps, "feedback"))
plt.show()

# %% [markdown]
# The error follows the curvature, to the outside of the bend: the controller steers only where it is wrong already, so
# that it must be wrong in every bend. No gain mends that; what is missing is the angle that the bend itself takes.
#
# ## Mended
#
# `curvature_preview_0` is the curvature of the road at the car. The wheelbase times that is the angle of a car that
# does not slip; one that slips needs more of it with the speed, by its understeer gradient. `scenario.vehicle` is the
# car as a designer knows it.


# %%
class FeedbackAndBend(Feedback):
    """The PD, and the steady angle of the bend."""

    name = "feedback-and-bend"
    reads = (*Feedback.reads, "speed", "curvature_preview_0")

    def __init__(self, scenario):
        super().__init__(scenario)
        car = scenario.vehicle
        front, rear = car.cg_to_front_axle, car.cg_to_rear_axle
        softness = rear / car.front_cornering_stiffness - front / car.rear_cornering_stiffness
        self._wheelbase, self._understeer = car.wheelbase, car.mass * softness / car.wheelbase

    def command(self, at, memory, fresh):
        feedback, memory = super().command(at, memory, fresh)
        bend = (self._wheelbase + self._understeer * at["speed"] ** 2) * at["curvature_preview_0"]
        return feedback + bend, memory


summary = lanekeep_benchmarks.benchmark(
    "classical",
    ["yin-lqr-feedforward", Feedback, FeedbackAndBend],
    episodes=32,
    out="second",
    trace=True,
    overwrite=True,
)
table(summary)

# %%
draw(worst(*lanekeep_benchmarks.read("second"), "feedback-and-bend"))
plt.show()

# %% [markdown]
# All three have driven the same roads from the same starts, so a difference is one of the controllers. Whether it is
# more than chance, the paired intervals say, and `second/report.html` lets you play every failure:

# %%
for scenario in summary["scenarios"]:
    for row in scenario["policies"][1:]:
        by = row["difference_to_reference"]["rms_lateral_error"]
        print(
            f"{scenario['scenario']:20} {row['policy']:18} {by['value']:+.3f} m "
            f"({by['low']:+.3f} to {by['high']:+.3f}) beside yin-lqr-feedforward"
        )
