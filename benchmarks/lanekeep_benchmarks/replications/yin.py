"""Yin 2010: every figure of the slides, and what they claim, driven again in `LaneKeep-v0`.

The slides show no scales, print no car and no road: the car is the one decoded from the printed gains (`yin_decoding`),
the road is `road="yin"`. Signs are Yin's: y_d and θ_d are path minus vehicle, angles are of the steering wheel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lanekeep_baselines.yin_design import STEERING_RATIO, YinModel
from lanekeep_benchmarks.replications import yin_plots as plots
from lanekeep_benchmarks.replications.passat import CurvatureSteps, Drive, Floats, drive
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_benchmarks.replications.yin_decoding import gains, open_numbers, steady_errors
from lanekeep_benchmarks.replications.yin_identification import identification
from lanekeep_benchmarks.replications.yin_support import support
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.vehicles import VEHICLES

CAR = VEHICLES["yin"]
#: Controllers by what the slides call them; the third is this project's redesign of the second.
LQR, OBSERVER, REDESIGN = "LQR", "LQR with observer, printed gains", "LQR with observer, redesigned"
POLICIES = {LQR: "yin-lqr", OBSERVER: "yin-lqr-observer-printed", REDESIGN: "yin-lqr-observer"}
#: Longest drive of the whole road, s.
LONGEST = 160.0


def wheel(driven: Drive) -> Floats:
    """Return the steering wheel's angle, rad, (steps,)."""
    return STEERING_RATIO * driven["steering_angle"][:, 0]


def straight(found: Replication) -> None:
    """Scenario (a): 60 km/h on a straight, 1.5 m beside the path."""
    start = {"lateral_error": 1.5, "heading_error": 0.0}
    driven = drive(
        "LaneKeep-v0", "yin-lqr", 20.0, start, road="straight", speed=60.0 / 3.6, control_step=0.01, preview=1
    )
    error, heading = -driven["lateral_error"][:, 0], -driven["heading_error"][:, 0]
    found.pictures["scenario_a.png"] = plots.straight(driven.time, error, heading, wheel(driven))
    for name, last, unit in (("lateral error", error[-1], "m"), ("heading error", heading[-1], "rad")):
        quantity = f"(a) {name} that remains, 60 km/h from 1.5 m, after 20 s"
        found.rows.append(Row(quantity, "scenario (a), in words", 0.0, abs(float(last)), unit, 3))
    inside = float(driven.time[np.flatnonzero(np.abs(error) > 0.05)[-1] + 1])
    beyond = 1000.0 * max(0.0, float(error.max()))
    found.tables.append(
        Table(
            "Scenario (a): what the slide says in words",
            ("statement", "here"),
            (
                ("no remaining lateral or heading error", f"{1000 * abs(error[-1]):.1f} mm after 20 s"),
                ("good dynamic control", f"within 5 cm after {inside:.1f} s, {beyond:.0f} mm beyond the path"),
            ),
        )
    )


def along(driven: Drive, values: Floats) -> Floats:
    """Return values (steps,) while the car is on the road, which goes on straight behind its end."""
    part: Floats = values[driven.station[:, 0] < driven.roads[0].length]
    return part


def whole_road(policy: str, **keywords: Any) -> Drive:
    """Drive scenario (b) from the road's start, 1.0 m beside it."""
    start = {"lateral_error": 1.0, "arc_length": 0.0}
    return drive(
        "LaneKeep-v0", policy, LONGEST, start, **{"road": "yin", "control_step": 0.05, "preview": 1, **keywords}
    )


def scenario_b(found: Replication) -> None:
    """Set path, driven path, deviations and steering of the LQR alone and with the observer, printed and redesigned."""
    runs = {name: whole_road(policy) for name, policy in POLICIES.items()}
    first = runs[LQR]
    bends = {name: along(run, run["curvature"][:, 0]) for name, run in runs.items()}
    set_path(found, first, along(first, first["speed"][:, 0]), bends[LQR])
    found.pictures["driven_path.png"] = plots.driven_path(
        first.roads[0], {name: run.world() for name, run in runs.items()}
    )
    errors = {name: -along(run, run["lateral_error"][:, 0]) for name, run in runs.items()}
    wheels = {name: along(run, wheel(run)) for name, run in runs.items()}
    found.pictures["lqr_deviation.png"] = plots.deviation(
        "Unacceptably large deviation: the LQR alone", first.time, {LQR: errors[LQR]}
    )
    found.pictures["compensated.png"] = plots.compensated(first.time, errors, wheels, (OBSERVER, REDESIGN))
    found.pictures["comparison_deviation.png"] = plots.deviation("Comparison of the deviations", first.time, errors)
    found.pictures["comparison_steering.png"] = plots.steering(first.time, bends[LQR], wheels)
    source = "benchmark, road yin, checked"
    for name, rms, peak in ((LQR, 2.39, 3.04), (OBSERVER, 1.83, 3.44)):
        numbers = sizes(errors[name], bends[name])
        found.rows.append(Row(f"(b) RMS deviation, {name}", source, rms, numbers[0], "m", 2))
        found.rows.append(Row(f"(b) largest deviation in the sharp bends, {name}", source, peak, numbers[2], "m", 2))
    claims(found, errors, bends)


def sizes(error: Floats, curvature: Floats) -> tuple[float, float, float]:
    """Return RMS, largest, and largest in bends of more than half of the peak curvature, m."""
    size, sharp = np.abs(error), np.abs(curvature) > 0.5 * np.abs(curvature).max()
    return math.sqrt(float(np.mean(error**2))), float(size.max()), float(size[sharp].max())


def set_path(found: Replication, driven: Drive, speed: Floats, curvature: Floats) -> None:
    """What the slide prints of the set path and its drive."""
    station = along(driven, driven.station[:, 0])
    lateral = speed**2 * curvature
    found.pictures["set_path.png"] = plots.set_path(station, curvature, speed, lateral)
    peak, source = driven.roads[0].peak_curvature, "scenario (b)"
    for quantity, printed, here, unit, digits in (
        ("(b) largest curvature", 0.0109, peak, "1/m", 4),
        ("(b) smallest radius", 91.8, 1.0 / peak, "m", 1),
        ("(b) lowest speed", 68.0, 3.6 * speed.min(), "km/h", 0),
        ("(b) highest speed", 180.0, 3.6 * speed.max(), "km/h", 0),
        ("(b) largest lateral acceleration of the path", 0.4, np.abs(lateral).max() / GRAVITY, "g", 1),
        ("(b) deviation at the start, about", 1.0, abs(driven["lateral_error"][0, 0]), "m", 1),
    ):
        found.rows.append(Row(quantity, source, printed, float(here), unit, digits))


def claims(found: Replication, errors: dict[str, Floats], bends: dict[str, Floats]) -> None:
    """Where the slides' "clearly smaller deviation" holds and where not."""
    rows = []
    for name, error in errors.items():
        signs = np.sign(bends[name])
        pieces = np.split(np.abs(error), np.flatnonzero(np.diff(signs)) + 1)
        peaks = " ".join(f"{piece.max():.2f}" for piece in pieces if len(piece) > 20)
        rows.append((name, *(f"{number:.2f}" for number in sizes(error, bends[name])), peaks))
    found.tables.append(
        Table(
            "Clearly smaller deviation: true of the RMS, and with the printed gains not of the peak in the sharp bends",
            ("controller", "RMS [m]", "largest [m]", "in the sharp bends [m]", "largest of each bend, in order [m]"),
            tuple(rows),
        )
    )


#: RMS of the lateral error over 5 to 40 s on sine roads, m, by controller and wavelength, m: checked.
SINES = {
    LQR: (2.32, 2.41, 2.43, 2.24),
    OBSERVER: (2.16, 1.58, 1.22, 1.17),
    REDESIGN: (0.30, 0.18, 0.14, 0.14),
}
WAVES = (400.0, 800.0, 1600.0, 3200.0)


def sines(found: Replication) -> None:
    """The same three on sine roads, from 1 m beside the path."""
    for name, expected in SINES.items():
        for wave, rms in zip(WAVES, expected, strict=True):
            driven = drive(
                "LaneKeep-v0", POLICIES[name], 40.0, {"lateral_error": 1.0, "arc_length": 0.0}, control_step=0.01,
                road={"kind": "sine", "wavelength": wave}, speed=18.97, preview=1,
            )  # fmt: skip
            error = driven["lateral_error"][driven.time >= 5.0, 0]
            quantity = f"RMS deviation, sine of {wave:.0f} m, {name}"
            found.rows.append(Row(quantity, "18.97 m/s, checked", rms, math.sqrt(float(np.mean(error**2))), "m", 2))


def reaction(found: Replication) -> None:
    """ "Faster reaction": how long after a step of curvature the wheel turns, and how far it is behind on the road."""
    road, before = CurvatureSteps(curvatures=(0.003,), before=50.0), 50.0
    model = YinModel.of(CAR)
    rows = []
    for name, policy in POLICIES.items():
        driven = drive(
            "LaneKeep-v0", policy, 12.0, {"lateral_error": 0.0, "heading_error": 0.0, "arc_length": 0.0}, road=road,
            control_step=0.01, speed=25.0, preview=1,
        )  # fmt: skip
        turned, began = wheel(driven), before / 25.0
        steady = steady_wheel(model, 25.0, 0.003)
        half, most = (driven.time[np.argmax(turned >= share * steady)] - began for share in (0.5, 0.9))
        late = lag(whole_road(policy, control_step=0.01), model)
        largest = float(np.abs(driven["lateral_error"][:, 0]).max())
        rows.append((name, f"{half:.2f}", f"{most:.2f}", f"{largest:.2f}", f"{late:+.2f}"))
    found.tables.append(
        Table(
            "The slides' faster reaction of the LQR with compensation: steering wheel after a step of the path's"
            " curvature (0 to 0.003 1/m, 25 m/s), and behind what the curve asks for on the road of (b). With the"
            " printed gains the wheel is hardly faster; with those designed anew it is",
            (
                "controller",
                "half of the steady angle after [s]",
                "nine tenths after [s]",
                "largest deviation [m]",
                "behind on the road [s]",
            ),
            tuple(rows),
        )
    )


def steady_wheel(model: YinModel, speed: Floats | float, curvature: Floats | float) -> Any:
    """Return the steering wheel's angle in a steady curve, rad."""
    _, (base, growing) = model.steady_curve()
    return (base + growing * np.square(speed)) * np.asarray(curvature)


def lag(driven: Drive, model: YinModel) -> float:
    """Return by how many seconds the wheel follows what the steady curve asks for, where both are most alike."""
    turned = along(driven, wheel(driven))
    asked = steady_wheel(model, along(driven, driven["speed"][:, 0]), along(driven, driven["curvature"][:, 0]))
    step, most = driven.scenario.control_step, 1.0
    begin, reach = round(10.0 / step), round(most / step)  # the start beside the path is over
    late = np.arange(-reach, reach + 1)
    part = asked[begin:-reach]
    likeness = [float(np.corrcoef(turned[begin + k : begin + k + len(part)], part)[0, 1]) for k in late]
    return step * int(late[int(np.argmax(likeness))])


#: Cars with the same b2 and a22, which the gains tell; what they do not tell is changed one at a time.
EQUIVALENT: dict[str, dict[str, float]] = {
    "the shipped car": {},
    "mass 1400 kg": {"mass": 1400.0},
    "mass 2000 kg": {"mass": 2000.0},
    "yaw inertia 2200 kg m²": {"yaw_inertia": 2200.0},
    "yaw inertia 3200 kg m²": {"yaw_inertia": 3200.0},
    "axles 1.2 and 1.6 m": {"cg_to_front_axle": 1.2, "cg_to_rear_axle": 1.6},
    "axles 1.4 and 1.4 m": {"cg_to_front_axle": 1.4, "cg_to_rear_axle": 1.4},
}


def equivalent_car(**changes: float) -> dict[str, Any]:
    """Return a car that differs from the shipped one, with the stiffnesses that keep b2 and a22 (N/rad)."""
    model, base = YinModel.of(CAR), {"yaw_inertia": CAR.yaw_inertia}
    sizes = {**base, "cg_to_front_axle": CAR.cg_to_front_axle, "cg_to_rear_axle": CAR.cg_to_rear_axle, **changes}
    inertia, to_front, to_rear = (sizes[name] for name in ("yaw_inertia", "cg_to_front_axle", "cg_to_rear_axle"))
    front = model.b2 * STEERING_RATIO * inertia / to_front
    rear = (-model.a22 * inertia - front * to_front**2) / to_rear**2
    return {"base": "yin", **changes, "front_cornering_stiffness": front, "rear_cornering_stiffness": rear}


def equivalent_cars(found: Replication) -> None:
    """Whether the conclusions hang on what the gains do not tell."""
    rows = []
    for name, changes in EQUIVALENT.items():
        car, cells = equivalent_car(**changes), [name]
        for policy in POLICIES.values():
            driven = whole_road(policy, vehicle=car)
            error = along(driven, driven["lateral_error"][:, 0])
            cells.append(f"{math.sqrt(float(np.mean(error**2))):.2f}")
        cells += [f"{car[key] / 1000.0:.1f}" for key in ("front_cornering_stiffness", "rear_cornering_stiffness")]
        rows.append(tuple(cells))
    found.tables.append(
        Table(
            "Seven cars with the gains' b2 and a22: RMS deviation on the road of (b) [m]",
            ("car", *POLICIES, "front stiffness [kN/rad]", "rear"),
            tuple(rows),
        )
    )


STEPS = (
    ("printed gains", gains),
    ("what they leave open", open_numbers),
    ("steady errors", steady_errors),
    ("identification", identification),
    ("scenario (a)", straight),
    ("scenario (b)", scenario_b),
    ("sine roads", sines),
    ("steering reaction", reaction),
    ("equivalent cars", equivalent_cars),
    ("lane keeping support", support),
)
