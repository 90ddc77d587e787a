"""Werling, Gröll, Bretthauer 2008: Figures 8 to 10, and what the article claims without a number.

The article prints neither the car's mass and tyres nor its actuators, paths and gains; its figures were checked with
values that bring them out, which are those of `passat` and of the policies. "Checked" numbers were recomputed from its
equations by others than the authors of this code.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from lanekeep_baselines.werling import WerlingLateral, WerlingReverse, WerlingReverseAhead
from lanekeep_baselines.werling_lateral import WerlingMeasured, WerlingTuning, blended_steering
from lanekeep_baselines.werling_multi import WerlingDrive
from lanekeep_baselines.werling_tyres import WerlingCar
from lanekeep_benchmarks.replications import werling_plots as plots
from lanekeep_benchmarks.replications.passat import Drive, Floats, ReverseBends, drive
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_benchmarks.replications.werling_robustness import actuators, jumps, wrong_predictions
from lanekeep_benchmarks.replications.werling_traffic import START, TRAFFIC, comfort, noise, tracking
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.vehicles import VEHICLES

CAR = VEHICLES["passat"]
#: Length of the mean over the acceleration before the jerk is taken, s.
SMOOTH = 0.3


class SlowReverse(WerlingReverse):
    """The law (23) as printed with k = 1 1/m."""

    wave_number: ClassVar[float] = 1.0


class Rolling(WerlingLateral):
    """The law (23) at any speed, steered from the centre of gravity."""

    tuning: ClassVar[WerlingTuning] = WerlingTuning(slow=50.0, fast=51.0)


def limited(driven: Drive, friction: float) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return where the law says that the path asks for more than the tyres give, (steps, cars)."""
    car, shape = WerlingCar.of(driven.scenario.vehicle, friction), driven["speed"].shape
    state = (driven[name].ravel() for name in ("lateral_error", "heading_error", "sideslip", "yaw_rate", "speed"))
    kappa = driven["curvature"].ravel()
    _, flags = blended_steering(car, WerlingTuning(), WerlingMeasured(*state), np.ones_like(kappa), kappa)
    return flags.reshape(shape)


def figure_8(found: Replication) -> None:
    """The evasive path at 55 km/h from 0.8 m beside it, on dry road and on friction 0.3."""
    start = {"lateral_error": 0.8, "road_index": 0}
    rows, runs = [], {}
    for friction in (1.0, 0.5, 0.3):
        driven = drive("Evasive-v0", "werling-lateral", 7.0, start, friction=friction)
        flags, d = limited(driven, friction)[:, 0], np.abs(driven["lateral_error"][:, 0])
        reached = float(np.abs(driven["lateral_acceleration"]).max())
        flagged = f"{driven.time[flags][0]:.1f} to {driven.time[flags][-1]:.1f}" if flags.any() else "never"
        rows.append(
            (
                f"{friction:g}",
                f"{friction * GRAVITY:.2f}",
                f"{reached:.2f}",
                flagged,
                f"{d.max():.2f}",
                f"{d[-1]:.3f}",
                f"{np.degrees(np.abs(driven['sideslip']).max()):.1f}",
            )
        )
        runs[f"friction {friction:g}"] = driven
        if friction == 1.0:
            source = "Figure 8, checked"
            until = d[: round(5.0 / 0.02) + 1]
            rise = 1000.0 * float((until - np.minimum.accumulate(until)).max())
            found.rows.append(Row("largest lateral acceleration, 55 km/h", "Figure 8", 4.0, reached, "m/s²", 2))
            found.rows.append(Row("error after 3 s, from 0.8 m", source, 0.215, float(d[150]), "m"))
            found.rows.append(Row("largest rise of the error, at most", source, 5.0, rise, "mm", 1))
    found.pictures["figure_8.png"] = plots.figure_8(runs)
    found.tables.append(
        Table(
            "Figure 8's path on slippery roads: the law says where it cannot be followed, and the car does not spin",
            (
                "friction",
                "tyres give at the most [m/s²]",
                "largest lateral acceleration [m/s²]",
                "flagged as infeasible [s]",
                "largest error [m]",
                "error after 7 s [m]",
                "largest sideslip [°]",
            ),
            tuple(rows),
        )
    )


#: Of Figure 9 with a lag of 0.1 s: what is said of the number, and the number, cm.
CHECKED = {
    (WerlingReverse, 1.0): (" (0.7 to 0.9)", 0.8),
    (SlowReverse, 1.4): (" (2.4 to 3.6)", 3.0),
    (WerlingReverseAhead, 1.0): (", at most", 0.4),
    (WerlingReverseAhead, 1.4): (", at most", 0.4),
}


def figure_9(found: Replication) -> None:
    """Backing up along bends near the turning circle at walking speed."""
    laws: dict[str, type[WerlingReverse]] = {
        "k = 2, as printed": WerlingReverse,
        "k = 1, as printed": SlowReverse,
        "k = 1, curvature ahead": WerlingReverseAhead,
    }
    rows, shown = [], {}
    for lag in (0.05, 0.1):
        vehicle = {"base": "passat", "steering": {"lag": lag, "angle_limit": 0.6}}
        for transition in (0.4, 0.5, 3.0):
            road = ReverseBends(transition=transition)
            way = road.build()[0].length - 5.0
            for speed in (1.0, 1.4):
                cells = []
                for name, law in laws.items():
                    driven = drive("ReversePath-v0", law, way / speed, road=road, speed=speed, vehicle=vehicle)
                    worst = 100.0 * float(np.abs(driven["lateral_error"]).max())
                    cells.append(f"{worst:.2f}")
                    if transition == 0.5 and lag == 0.1:
                        shown[f"{name}, {speed:g} m/s"] = driven
                        checked = CHECKED.get((law, speed))
                        if checked is not None:
                            text, published = checked
                            quantity = f"largest error backwards, R = 5 m, lag 0.1 s, {speed:g} m/s, {name}{text}"
                            found.rows.append(Row(quantity, "Figure 9, checked", published, worst, "cm", 2))
                rows.append((f"{lag:g}", f"{transition:g}", f"{speed:g}", *cells))
    found.pictures["figure_9.png"] = plots.figure_9(shown, CAR)
    found.tables.append(
        Table(
            "Figure 9: largest error of the rear axle [cm], bends of 5 m radius to both sides (printed: under 1 cm)",
            ("steering lag [s]", "clothoid [m]", "speed [m/s]", *laws),
            tuple(rows),
        )
    )


def smoothed(values: Floats, step: float) -> Floats:
    """Return the running mean over `SMOOTH`."""
    count = round(SMOOTH / step)
    return np.convolve(values, np.full(count, 1.0 / count), mode="same")


def figure_10(found: Replication) -> None:
    """Starting, a set speed, a car ahead, a stop point."""
    driven = drive("Drive-v0", "werling-drive", 50.0, START, road="straight", traffic=TRAFFIC, slope=0.0, wind=0.0)
    time, laws = driven.time, WerlingDrive.longitudinal
    v, gear, stop = (driven[name][:, 0] for name in ("speed", "gear", "stop_gap"))
    asked = laws.speed_rate * (driven["set_speed"][:, 0] - v)
    takeover = int(np.flatnonzero((time > 4.5) & (asked < laws.most))[0])
    up = time[1:][np.diff(gear) > 0]
    up = up[up < 15.0]
    late = int(np.searchsorted(time, 30.0 - 1e-6)) - 1
    wanted = laws.standing_gap + laws.time_gap * v[late]
    stands = int(np.flatnonzero((time > 37.0) & (v < 1e-3))[0])
    mean = smoothed(driven["acceleration"][:, 0], driven.scenario.control_step)
    jerk = np.abs(np.gradient(mean, driven.scenario.control_step))
    ending, before = (time >= time[stands] - 3.0), (time > 38.0) & (time < time[stands] - 3.0)
    braking = (time > 38.0) & (time < 41.0)
    # (32) asks for a_h,min as it begins to brake; what is driven until the brake acts is to be made good behind that.
    lost = driven.scenario.powertrain.pedal_lag + driven.scenario.control_step
    even = laws.braking / (1.0 + 2.0 * laws.braking * lost / v[np.searchsorted(time, 37.0 - 1e-6)])
    source = "Figure 10, checked"
    at_45 = 100.0 * abs(float(stop[np.searchsorted(time, 45.0)]))
    for quantity, where, published, reproduced, unit, digits in (
        ("speed control takes over", "Figure 10", 12.5, time[takeover], "s", 2),
        ("shifts up before the car ahead", "Figure 10", 3.0, len(up), "", 0),
        (
            "largest acceleration until then",
            "Figure 10",
            laws.most,
            mean[time < time[takeover]].max(),
            "m/s²",
            1,
        ),
        ("gap over L + τ v when the lead car turns off", "(28)", 1.0, driven["lead_gap"][late, 0] / wanted, "", 3),
        ("standstill (44.7 to 45.0 checked)", "Figure 10", 45.0, time[stands], "s", 2),
        ("distance of the stop point at 45 s, at most", "Figure 10", 2.0, at_45, "cm", 1),
        ("mean acceleration from 38 to 41 s", "(32), checked", even, mean[braking].mean(), "m/s²", 2),
        ("largest jerk in the last 3 s, at most", source, 2.5, jerk[ending].max(), "m/s³", 2),
    ):
        found.rows.append(Row(quantity, where, published, float(reproduced), unit, digits))
    found.pictures["figure_10.png"] = plots.figure_10(driven, mean, float(time[takeover]), laws)
    found.tables.append(
        _without_numbers(
            f"largest acceleration {mean[time < time[takeover]].max():.2f} m/s²",
            f"wanted acceleration changes by {np.abs(np.diff(asked))[takeover - 1]:.3f} m/s² in that step",
            f"at {', '.join(f'{t:.1f}' for t in up)} s",
            f"{mean[braking].min():.2f} to {mean[braking].max():.2f} m/s² from 38 to 41 s",
            f"at most {jerk[ending].max():.2f} m/s³ in the last 3 s, with a holding brake below"
            f" {100.0 * WerlingDrive.stands[0]:.0f} cm/s; {jerk[before].max():.2f} before, as it shifts down",
            f"stop point {100.0 * stop[-1]:.1f} cm ahead after 50 s",
        )
    )


def _without_numbers(*here: str) -> Table:
    """Return the table of Figure 10's statements, with what stands for each here."""
    statements = (
        "a_max = 1 m/s² is reached",
        "taken over without a bump",
        "three shifts on the way",
        "deceleration nearly constant",
        "no jerk at the end",
        "stays",
    )
    title = f"Figure 10: what the article says without a number (jerk: of the acceleration's mean over {SMOOTH:g} s)"
    return Table(title, ("statement", "here"), tuple(zip(statements, here, strict=True)))


def low_speed(found: Replication) -> None:
    """The dynamic model against the rolling car at low speed, on a circle of 10 m."""
    radius, rows = 10.0, []
    # The centre of gravity's; the rear axle's is smaller.
    rear = math.sqrt(radius**2 - CAR.cg_to_rear_axle**2)
    angle = math.atan(CAR.wheelbase / rear)
    for speed in (0.5, 1.0, 2.0, 3.0, 4.0, 5.0):
        rates, errors = [], []
        for dynamics in ("kinematic", "dynamic"):
            common: dict[str, Any] = {
                "dynamics": dynamics,
                "tyre": "magic_formula" if dynamics == "dynamic" else "linear",
                "vehicle": "passat",
                "road": {"kind": "circle", "radius": radius},
                # The rolling car's speed is its rear axle's, the other one's the centre of gravity's.
                "speed": speed if dynamics == "kinematic" else speed * radius / rear,
                "preview": 1,
                "max_steering_angle": 0.6,
            }
            held = drive("LaneKeep-v0", angle / 0.6, 3.0, {"lateral_error": 0.0}, **common)
            rates.append(float(held["yaw_rate"][-1, 0]))
            steered = drive("LaneKeep-v0", Rolling, 12.0 / speed, {"lateral_error": 0.0}, **common)
            errors.append(100.0 * float(steered["lateral_error"][-1, 0]))
        slip = 100.0 * (rates[1] / rates[0] - 1.0)
        rows.append(
            (
                f"{speed:g}",
                *(f"{rate:.4f}" for rate in rates),
                f"{slip:.2f}",
                *(f"{error:.2f}" for error in errors),
                f"{errors[1] - errors[0]:.2f}",
            )
        )
    found.tables.append(
        Table(
            "Car with slip against the rolling one on a circle of 10 m: with one steering angle, and with the law (23)",
            (
                "rear axle's speed [m/s]",
                "yaw rate, rolling [rad/s]",
                "with slip [rad/s]",
                "difference [%]",
                "lateral error, rolling [cm]",
                "with slip [cm]",
                "difference [cm]",
            ),
            tuple(rows),
        )
    )


STEPS = (
    ("Figure 8", figure_8),
    ("Figure 9", figure_9),
    ("Figure 10", figure_10),
    ("noise of the throttle", noise),
    ("comfort and safety", comfort),
    ("braking in a swerve", tracking),
    ("actuators", actuators),
    ("wrong predictions", wrong_predictions),
    ("jumps", jumps),
    ("low speed", low_speed),
)
