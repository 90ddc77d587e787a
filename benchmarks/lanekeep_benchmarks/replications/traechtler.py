"""Trächtler, Lohmann, Struck 1992, driven again in `CameraLane-v0` and `TurnOff-v0`.

The article prints few numbers: T = 0.25 s, K2, and Figures 5 and 7 as curves. "Checked" numbers were recomputed from
its equations by others than the authors of this code.
"""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np

import lanekeep_env  # noqa: F401
from lanekeep_baselines.traechtler_model import CameraModel
from lanekeep_benchmarks.replications import traechtler_plots as plots
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_benchmarks.replications.traechtler_model import derivative_part, figure_2, figure_3, set_points
from lanekeep_benchmarks.replications.traechtler_turns import angles, plan_errors
from lanekeep_benchmarks.replications.van import NO_BACKLASH, Drive, Floats, drive, simulate

EDGE_RADII = (8.0, 10.0, 12.0, 20.0)
SPEEDS = (2.0, 4.0, 6.0)


def steering(feedback: str, backlash: float = math.radians(2.0)) -> dict[str, object]:
    """The van with a steering loop closed on the road wheel or on the motor."""
    return {"base": "van", "steering": {**NO_BACKLASH["steering"], "backlash": backlash, "feedback": feedback}}  # type: ignore[dict-item]


def actuator(found: Replication) -> None:
    """T of the closed loop from a small step, behind the gear."""
    step = math.radians(1.0)
    env = gym.make("lanekeep/CameraLane-v0", speed=0.0, road="straight", vehicle=NO_BACKLASH, control_step=0.01)
    env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    angle = [0.0]
    for _ in range(100):
        angle.append(float(env.step(np.array([step / 0.6], dtype=np.float32))[0][3]))
    env.close()
    time, rest = 0.01 * np.arange(101), np.log(1.0 - np.array(angle) / step)
    lag = -1.0 / np.polyfit(time[:60], rest[:60], 1)[0]
    found.rows.append(Row("time constant T of the steering loop, small step", "section 3", 0.25, lag, "s"))


def pure_control(wanted: Floats, step: float, gap: float, rate: float) -> Floats:
    """Return the road wheel's angle (rad) behind a motor that only gets the set-point's speed: no angle is fed back.

    Where the set-point moves faster than ``rate`` (rad/s) the motor loses what it never finds again; the wheel follows
    it through a gear with ``gap`` rad of backlash.
    """
    motor = wanted[0] + np.concatenate([[0.0], np.cumsum(np.clip(np.diff(wanted), -rate * step, rate * step))])
    wheel, angle = [], motor[0]
    for place in motor:
        angle = min(max(angle, place - gap / 2), place + gap / 2)
        wheel.append(angle)
    return np.array(wheel)


def figure_5(found: Replication) -> None:
    """Set-point against angle of a slow drive from side to side: pure control of the motor, and the loop."""
    step, gap, motor = 0.04, math.radians(2.0), math.radians(20.0)
    time = step * np.arange(12_000)
    wanted = np.radians(16.0) * np.sin(2 * np.pi * time / 240.0) * np.cos(2 * np.pi * time / 92.0)
    curves = {"without loop": pure_control(wanted, step, gap, motor)}
    for called, feedback in (("with loop", "road_wheel"), ("loop on the motor", "motor")):
        env = gym.make(
            "lanekeep/CameraLane-v0", speed=0.0, road="straight", vehicle=steering(feedback), episode_steps=20_000
        )
        env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
        followed = [env.step(np.array([want / 0.6], dtype=np.float32))[0][3] for want in wanted]
        env.close()
        curves[called] = np.array(followed)
    found.pictures["figure_5.png"] = plots.figure_5(
        wanted, {name: curves[name] for name in ("without loop", "with loop")}
    )
    rows = []
    for name, angle in curves.items():
        # Width of the hysteresis: between set-points that rise and fall through 0 on wide swings.
        rate = np.gradient(wanted)
        near = (np.abs(wanted) < np.radians(3.0)) & (np.abs(rate) > 0.5 * np.abs(rate).max())
        off = wanted - angle
        width = np.degrees(np.mean(off[near & (rate > 0.0)]) - np.mean(off[near & (rate < 0.0)]))
        rows.append((name, f"{np.degrees(np.sqrt(np.mean((angle - wanted) ** 2))):.2f}", f"{width:.2f}"))
    found.tables.append(
        Table(
            "Figure 5: steering angle against its set-point; without the loop the motor is only told to turn",
            ("steering", "RMS of angle − set-point [°]", "width of the hysteresis near 0 [°]"),
            tuple(rows),
        )
    )


def steady_curves(found: Replication) -> None:
    """The rear wheel's error in steady curves, K2 = 2 l/(l + f)²."""
    checked = {100.0: ("3", "3"), 50.0: ("14.5", "11"), 30.0: ("43", "25"), 20.0: ("105", "44")}
    for edge, errors in checked.items():
        for side, sign, error in (("right", -1.0, errors[0]), ("left", 1.0, errors[1])):
            radius = sign * (edge - sign * 1.5)
            driven = drive(
                "CameraLane-v0", "traechtler-pd", 60.0, road={"kind": "circle", "radius": radius}, speed=4.0,
                vehicle=NO_BACKLASH,
            )  # fmt: skip
            reached = 1000.0 * abs(float(driven.lateral[-1]))
            quantity = f"rear wheel's error in a {side} curve, edge radius {edge:.0f} m"
            digits = len(error.partition(".")[2])
            found.rows.append(Row(quantity, "(11), checked", float(error), reached, "mm", digits))


def damping(found: Replication) -> None:
    """Damping of the linear loop without and with K3."""
    model = CameraModel(3.0, 3.5, 0.25)
    cases = ((0.0, 1.0, 0.706), (0.0, 6.0, 0.540), (1.0, 1.0, math.sqrt(0.5)), (1.0, 6.0, math.sqrt(0.5)))
    for k3, speed, checked in cases:
        loop = np.polymul(
            [k3 * model.derivative_gain, model.proportional_gain],
            [model.reach * speed / model.wheelbase, speed**2 / model.wheelbase],
        )
        poles = np.roots(np.polyadd([model.lag, 1.0, 0.0, 0.0], loop))
        swinging = poles[np.abs(poles.imag) > 1e-9]
        ratio = float((-swinging.real / np.abs(swinging)).min())
        gain = "K3 = T K2" if k3 else "K3 = 0"
        found.rows.append(Row(f"damping, {gain}, {speed:.0f} m/s", "(12), checked", checked, ratio))


def limit_cycles(found: Replication) -> None:
    """Half of the swing of d on a straight, with 2° of backlash."""
    cases = (("motor", 4.0, 0.16), ("road_wheel", 2.0, 0.023), ("road_wheel", 4.0, 0.043), ("road_wheel", 6.0, 0.061))
    for feedback, speed, checked in cases:
        driven = drive(
            "CameraLane-v0", "traechtler-pd", 400.0 / speed, road="straight", speed=speed, vehicle=steering(feedback),
            offset=0.3,
        )  # fmt: skip
        late = driven.edge[int(0.6 * len(driven.edge)) :]
        place = "on the motor" if feedback == "motor" else "behind the gear"
        quantity = f"limit cycle of d, loop {place}, {speed:.0f} m/s"
        digits = 2 if feedback == "motor" else 3
        found.rows.append(Row(quantity, "section 3, checked", checked, float(np.ptp(late)) / 2, "m", digits))


def blind_turns(found: Replication) -> None:
    """90° right turns: errors all along and after the switch back, jumps of the command, the motor at its limit."""
    rows = []
    for edge in EDGE_RADII:
        for speed in SPEEDS:
            for policy in ("traechtler-blind", "traechtler-inverse"):
                cells = [f"{edge:.0f}", f"{speed:.0f}", policy.removeprefix("traechtler-")]
                for factor in (1.0, 0.9, 1.1):
                    driven = blind_turn(edge, speed, policy, factor)
                    lost, seen = switches(driven)
                    after = driven.station > driven.station[seen] + 25.0
                    cells.append(f"{np.abs(driven.lateral[lost:]).max():.2f}")
                    if factor == 1.0:
                        jump = math.degrees(abs(driven.command[seen] - driven.command[seen - 1]))
                        busy = np.abs(driven.rate[lost:]) > 0.999 * math.radians(20.0)
                        cells += [f"{np.abs(driven.lateral[after]).max():.3f}", f"{jump:.1f}"]
                        cells.append(f"{100 * np.mean(busy[driven.station[lost:] < driven.station[seen] + 25.0]):.1f}")
                rows.append(tuple(cells))
    found.tables.append(
        Table(
            "Blind turns by 90° to the right, from the loss of the edge on (2° of backlash)",
            (
                "edge radius [m]",
                "speed [m/s]",
                "blind control",
                "largest error [m]",
                "25 m after the switch back [m]",
                "jump at the switch back [°]",
                "motor at its limit [%]",
                "largest error [m], wheelbase taken 10 % short",
                "10 % long",
            ),
            tuple(rows),
        )
    )


def blind_turn(edge: float, speed: float, policy: str, factor: float = 1.0) -> Drive:
    """Drive `TurnOff-v0`, a turn of edge radius ``edge``; the policy believes in ``factor`` times the wheelbase."""
    road = {
        "kind": "turn-off",
        "count": 1,
        "side": "right",
        "smallest_radius": edge + 1.5,
        "largest_radius": edge + 1.5,
    }
    believed = {"vehicle": {"base": "van", "cg_to_front_axle": 1.4 * factor, "cg_to_rear_axle": 1.6 * factor}}
    plan = {"plan": 24}  # far enough for the longer van as well
    return drive(
        "TurnOff-v0", policy, 140.0 / speed, believed if factor != 1.0 else None, road=road, speed=speed, **plan
    )


def switches(driven: Drive) -> tuple[int, int]:
    """Step at which the edge of the turn was lost, and at which the controller took it up again for good."""
    blind = np.flatnonzero(~driven.closed & (driven.station > driven.road.stations[3] - 10.0))
    return int(blind[0]), int(blind[-1]) + 1


def figure_7(found: Replication) -> None:
    """Left curve, straight, blind turn: the van against the linear simulation."""
    speed = 4.0
    driven = blind_turn(20.0, speed, "traechtler-blind")
    linear = simulate(driven, speed)
    lost, seen = switches(driven)
    reach, stations = driven.scenario.reach, driven.road.stations
    first = int(np.searchsorted(driven.station, stations[1] - reach))
    second = int(np.searchsorted(driven.station, stations[2]))
    calm = (np.abs(driven.heading) < math.radians(0.5)) & (np.abs(driven.edge - 1.5) < 0.05)
    third = second + int(np.argmax(calm[second:]))
    marks = {"t1": first, "t2": second, "t3": third, "t4": lost, "t5": seen}
    found.pictures["figure_7.png"] = plots.figure_7(driven, linear, marks)
    until = slice(0, lost)
    found.tables.append(
        Table(
            "Figure 7: the van against the linear simulation up to t4, edge radius 20 m, 4 m/s",
            ("quantity", "largest difference"),
            (
                ("edge distance d [m]", f"{np.abs(driven.edge - linear.edge)[until].max():.3f}"),
                ("steering angle δ [°]", f"{np.degrees(np.abs(driven.steer - linear.steer)[until].max()):.2f}"),
            ),
        )
    )


STEPS = (
    ("steering loop", actuator),
    ("Figure 2", figure_2),
    ("Figure 3", figure_3),
    ("Figure 5", figure_5),
    ("steady curves", steady_curves),
    ("damping", damping),
    ("derivative part", derivative_part),
    ("set points", set_points),
    ("limit cycles", limit_cycles),
    ("Figure 7", figure_7),
    ("blind turns", blind_turns),
    ("angles", angles),
    ("errors of the plan", plan_errors),
)
