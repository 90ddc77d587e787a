"""highway-env's car with tyres, `BicycleVehicle` of version 1.12, beside the same car here: what is known to be wrong.

Its axles are 2.5 m from the centre of gravity, its stiffnesses 30 N/rad per kg an axle, its inertia 29/12 m² per kg:
linear in small angles, yaw and sideslip are two first-order modes, -155.2/v and -60/v per second, and what comes out of
either simulation can be told in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from highway_env.vehicle.dynamics import BicycleVehicle
from highway_env.vehicle.kinematics import Vehicle
from matplotlib.figure import Figure

from lanekeep_benchmarks.plots import GRID, colour_of, png
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_env import layout as at
from lanekeep_env.adapters.highway import THEIR_CAR, EgoVehicle
from lanekeep_env.adapters.highway.action import plant_of
from lanekeep_env.physics.parameters import GRAVITY

#: Step of lane-keeping-v0, s.
STEP = 0.1
#: Of the yaw mode, 1/s, times the speed.
YAW = 2.0 * 30.0 * 2.5**2 / (29.0 / 12.0)
#: Real eigenvalue times step from which on RK4 grows: the root of z³/24 - z²/6 + z/2 = 1.
RK4_LIMIT = 2.7852935634
_SLOW, _FAST, _WIDE = 5.0, 20.0, 0.3
#: Over which a way is a straight line, s.
_SHORT = 0.001


def theirs(speed: float) -> BicycleVehicle:
    """Their car on no road."""
    return BicycleVehicle(None, [0.0, 0.0], 0.0, speed)


def ours(speed: float) -> EgoVehicle:
    """The same car here, with tyres that saturate at a friction of 1."""
    return EgoVehicle.of(plant_of({"vehicle": asdict(THEIR_CAR)}, STEP))(None, [0.0, 0.0], 0.0, speed)


def driven(car: Any, steering: float, seconds: float) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Drive with a held steering angle; return time (s), yaw rate (rad/s) and lateral acceleration (m/s²)."""
    car.act({"steering": steering, "acceleration": 0.0})
    rows = []
    for _ in range(round(seconds / STEP)):
        car.step(STEP)
        rows.append((car.yaw_rate, car.derivative[4, 0] + car.speed * car.yaw_rate))
    yaw, lateral = np.array(rows).T
    return {"time": STEP * np.arange(1, len(rows) + 1), "yaw": yaw, "lateral": lateral}


def growth(made: Callable[[float], Any], speed: float) -> float:
    """Return by what a small yaw rate is multiplied in a step; negative where it changes sign."""
    car, small = made(speed), 1e-6
    if isinstance(car, EgoVehicle):
        car.car[at.YAW_RATE] = -small  # to their right
    else:
        car.yaw_rate = small
    car.act({"steering": 0.0, "acceleration": 0.0})
    car.step(STEP)
    return float(car.yaw_rate) / small


def slow(found: Replication) -> None:
    """The yaw mode at 10 Hz: theirs leaves RK4's region of stability below 5.6 m/s."""
    z = YAW / _SLOW * STEP
    polynomial = 1.0 - z + z**2 / 2.0 - z**3 / 6.0 + z**4 / 24.0
    low, high = 4.0, 8.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if abs(growth(theirs, middle)) < 1.0 else (middle, high)
    rows = found.rows
    source = "RK4 in one step of 0.1 s, checked"
    rows.append(Row("speed below which their yaw rate grows by itself", source, YAW * STEP / RK4_LIMIT, high, "m/s"))
    rows.append(Row("their yaw rate after a step over before, 5 m/s", source, polynomial, growth(theirs, _SLOW), ""))
    rows.append(
        Row("the same here, 5 m/s", "exp(-155.2/v 0.1 s), checked", math.exp(-z), growth(ours, _SLOW), "", digits=3)
    )
    steady = _SLOW * 0.05 / 5.0
    runs = {"highway-env": driven(theirs(_SLOW), 0.05, 4.0), "lanekeep": driven(ours(_SLOW), 0.05, 4.0)}
    source = "v delta / l, checked"
    rows.append(Row("steady yaw rate at 5 m/s and 0.05 rad here", source, steady, runs["lanekeep"]["yaw"][-1], "rad/s"))
    found.tables.append(
        Table(
            "A small yaw rate after a step of 0.1 s over before: beyond 1 it grows",
            ("speed [m/s]", "highway-env", "lanekeep", "exact"),
            tuple(
                (f"{v:g}", f"{growth(theirs, v):.3f}", f"{growth(ours, v):.3f}", f"{math.exp(-YAW / v * STEP):.3f}")
                for v in (2.0, 3.0, 4.0, 5.0, 5.5, 6.0, 8.3, 15.0, 30.0)
            ),
        )
    )
    found.pictures["faults.png"] = _picture(runs, _wide())


def _wide() -> dict[str, dict[str, Any]]:
    return {"highway-env": driven(theirs(_FAST), _WIDE, 4.0), "lanekeep": driven(ours(_FAST), _WIDE, 4.0)}


def fast(found: Replication) -> None:
    """A tyre without an end: 0.3 rad at 20 m/s."""
    runs = _wide()
    most = {name: float(np.abs(run["lateral"]).max()) for name, run in runs.items()}
    for quantity, source, expected, name in (
        ("largest lateral acceleration, 20 m/s and 0.3 rad, there", "measured by others, checked", 26.0, "highway-env"),
        ("the same here, at most", "friction times gravity, checked", GRAVITY, "lanekeep"),
    ):
        found.rows.append(Row(quantity, source, expected, most[name], "m/s²", 0 if expected == 26.0 else 2))


def linear(found: Replication) -> None:
    """Their linear model beside the derivative of their own equations."""
    small, car = 1e-6, theirs(_FAST)
    _, matrix = car.lateral_lpv_dynamics()
    car.act({"steering": small, "acceleration": 0.0})
    true = car.derivative[4:, 0] / small
    for name, place, factor in (("lateral speed", 0, 1.0), ("yaw rate", 1, 2.0)):
        ratio = float(true[place] / matrix[place, 0])
        found.rows.append(
            Row(f"their equations over their LPV input matrix, {name}", "(2.21), (2.22)", factor, ratio, "")
        )


def way(found: Replication) -> None:
    """Their plain car's ``velocity`` points along its axis, and it drives another way."""
    rolling = EgoVehicle.of(plant_of({"vehicle": asdict(THEIR_CAR), "dynamics": "kinematic"}, _SHORT))
    source = "atan(tan(delta)/2), checked"
    for whose, kind, exact in (("theirs", Vehicle, math.atan(0.5 * math.tan(_WIDE))), ("ours", rolling, 0.0)):
        car = kind(None, [0.0, 0.0], 0.0, 10.0)
        car.act({"steering": _WIDE, "acceleration": 0.0})
        car.step(_SHORT)
        before, told = car.position.copy(), car.velocity
        car.step(_SHORT)
        x, y = car.position - before
        angle = math.degrees(math.atan2(y, x) - math.atan2(told[1], told[0]))
        quantity = f"way driven against `velocity`, rolling at 0.3 rad, {whose}"
        found.rows.append(Row(quantity, source, math.degrees(exact), angle, "°", 1))


def _picture(slow_runs: dict[str, dict[str, Any]], fast_runs: dict[str, dict[str, Any]]) -> bytes:
    figure = Figure(figsize=(9, 7), layout="constrained")
    upper, lower = figure.subplots(2, 1)
    for place, name in enumerate(slow_runs):
        upper.plot(slow_runs[name]["time"], slow_runs[name]["yaw"], color=colour_of(place), linewidth=1.3, label=name)
        lower.plot(fast_runs[name]["time"], fast_runs[name]["lateral"], color=colour_of(place), linewidth=1.3)
    lower.axhline(GRAVITY, color="#606060", linestyle="--", linewidth=1.0, label="friction 1 times gravity")
    upper.set_ylabel("yaw rate [rad/s]")
    lower.set_ylabel("lateral acceleration [m/s²]")
    lower.set_xlabel("time [s]")
    upper.set_title("5 m/s, 0.05 rad: its yaw mode is unstable at 10 Hz, and ends turning the other way", fontsize=10)
    lower.set_title("20 m/s, 0.3 rad: its tyre has no end", fontsize=10)
    for axes in (upper, lower):
        axes.grid(**GRID)
        axes.legend(frameon=False, fontsize=8)
    figure.suptitle("highway-env's car with tyres, and the same car here, steps of 0.1 s", fontsize=11)
    return png(figure)


STEPS = [
    ("slowly", slow),
    ("fast", fast),
    ("the linear model", linear),
    ("the way driven", way),
]
