"""Werling, Gröll, Bretthauer 2008: what the article says of the pedals in words: noise, comfort, set positions.

Of tracking a set position (x(t), y(t)), braking while swerving, the article has the aim alone, as its outlook; the law
and its bounds are those of `werling-drive`.
"""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np

from lanekeep_baselines.werling_longitudinal import LongitudinalTuning
from lanekeep_baselines.werling_multi import WerlingDrive
from lanekeep_benchmarks import evaluate
from lanekeep_benchmarks.replications import werling_plots as plots
from lanekeep_benchmarks.replications.passat import Drive, drive
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.vehicles import VEHICLES

#: Figure 10's time line, and its start.
TRAFFIC = [(0, "speed", 0), (4, "speed", 10), (15, "lead", 35, 7.5), (30, "lead_gone"), (37, "stop", 30)]
START = {"lateral_error": 0.0, "heading_error": 0.0, "arc_length": 0.0}
#: Of the measured speed, m/s.
NOISE = 0.02
#: Episodes full of hazards.
HAZARDS = 256
#: Speed of Figure 8, m/s.
SPEED = 55.0 / 3.6


def spread(values: Any) -> float:
    """Return the standard deviation of white noise on signals that change slowly, (steps, cars)."""
    return float(np.diff(values, 2, axis=0).std() / np.sqrt(6.0))


def noise(found: Replication) -> None:
    """Figure 10 with a noisy speed: from the take-over on it is in the throttle."""
    common: dict[str, Any] = {"road": "straight", "traffic": TRAFFIC, "slope": 0.0, "wind": 0.0}
    driven = drive("Drive-v0", "werling-drive", 16.0, START, 32, sensors={"speed": {"noise": NOISE}}, **common)
    throttle, time = np.maximum(driven.action[:, :, 1], 0.0), driven.time
    before, after = ((time > low) & (time < high) for low, high in ((11.0, 12.2), (13.0, 14.9)))
    train, car = driven.scenario.powertrain, VEHICLES["passat"]
    gear = driven["gear"][after].astype(int)
    ratio = np.array(train.gears)[gear] * train.final_drive / train.wheel_radius
    omega = driven["speed"][after] * ratio
    full = train.peak_torque * (1.0 - ((omega - train.peak_speed) / train.torque_width) ** 2)
    torque = full + train.drag_torque + train.drag_slope * omega
    rate = WerlingDrive.longitudinal.speed_rate
    expected = float(np.mean(rate * NOISE * car.mass / (torque * train.efficiency * ratio)))
    quantity = f"noise of the throttle in speed control, measured speed ± {NOISE:g} m/s"
    found.rows.append(Row(quantity, "(27), checked", expected, spread(throttle[after]), "", 3))
    found.tables.append(
        Table(
            'Figure 10: "an increase of the noise in the throttle", as speed control takes over',
            ("measured speed", "from 11 to 12.2 s, a_max", "from 13 to 14.9 s, speed control"),
            ((f"± {NOISE:g} m/s", f"{spread(throttle[before]):.4f}", f"{spread(throttle[after]):.4f}"),),
        )
    )


class Comfortable(WerlingDrive):
    """The article's one limit."""

    longitudinal: ClassVar[LongitudinalTuning] = WerlingDrive.longitudinal._replace(
        emergency=WerlingDrive.longitudinal.least
    )


def comfort(found: Replication) -> None:
    """What a_min = -3.5 m/s² alone costs where cars brake hard or cut in, and stop points come late."""
    rows, avoidable = [], []
    for name, law in (("a_min = -3.5 m/s² alone", Comfortable), ("and a second level", WerlingDrive)):
        env: Any = gym.make_vec(
            "lanekeep/Drive-v0",
            HAZARDS,
            "vector_entry_point",
            autoreset_mode="next_step",
            road="straight",
            traffic={"count": HAZARDS, "hazards": 1.0},
        )
        ever = dict.fromkeys(("contact", "overrun", "avoidable_contact", "avoidable_overrun"), np.zeros(HAZARDS, bool))
        for step in evaluate.drive(env, law(env.unwrapped.scenario), range(HAZARDS), {}):
            ever = {key: seen | (step.alive & (step.info[key] > 0.0)) for key, seen in ever.items()}
        env.close()
        counts = [int(seen.sum()) for seen in ever.values()]
        avoidable.append(sum(counts[2:]))
        rows.append((name, *(str(count) for count in counts)))
    quantity = f'avoidable contacts and overruns in {HAZARDS} hazards with a_min = -3.5 m/s², "without reducing safety"'
    found.rows.append(Row(quantity, "section 3.5, in words", 0.0, avoidable[0], "", 0))
    found.rows.append(
        Row(
            "avoidable contacts and overruns with a second level of a_min",
            "section 3.5, in words",
            0.0,
            avoidable[1],
            "",
            0,
        )
    )
    headings = ("limit of braking", "contacts", "overruns", "avoidable contacts", "avoidable overruns")
    found.tables.append(Table(f"Comfort and safety: {HAZARDS} episodes of hazards", headings, tuple(rows)))


def swerve(braking: float, start: dict[str, float] | None = None, ahead: float = 0.0, **keywords: Any) -> Drive:
    """Drive Figure 8's path at 55 km/h behind a set position that brakes in it, from 0.6 s on down to 5 m/s."""
    events = [(0, "speed", SPEED), (0, "position", ahead, SPEED)]
    if braking > 0.0:
        events.append((0.6, "position_speed", 5.0, braking))
    keywords = {"slope": 0.0, "wind": 0.0, "road": {"kind": "evasive", "side": "left"}, **keywords}
    return drive("Drive-v0", "werling-drive", 6.0, START | (start or {}), traffic=events, **keywords)


def tracking(found: Replication) -> None:
    """Set positions: the errors along and across the path, and what friction leaves of both."""
    quick = {"vehicle": {"base": "passat", "steering": {"lag": 0.0}}, "powertrain": {"pedal_lag": 0.0}}
    exact = swerve(3.0, {"lateral_error": 0.8}, -1.0, **quick)
    at, decay = round(2.0 / exact.scenario.control_step), 3.0 * np.exp(-2.0)
    # The law lays the centre of gravity outside, where the rear axle would run on the path.
    outside = 0.5 * exact.scenario.vehicle.cg_to_rear_axle**2 * exact["curvature"]
    for quantity, start, error in (
        ("way to the set position after 2 s, braking in the swerve", -1.0, exact["position_gap"]),
        ("lateral error in that", 0.8, exact["lateral_error"] + outside),
    ):
        found.rows.append(Row(quantity, "(9), checked", start * decay, float(error[at, 0]), "m", 2))
    rows, runs = [], {}
    for friction in (1.0, 0.5, 0.3):
        for braking in (0.0, 2.0, 4.0, 6.0):
            driven = swerve(braking, friction=friction)
            along, across = driven["acceleration"][:, 0], driven["lateral_acceleration"][:, 0]
            used = np.hypot(along, across) / (friction * GRAVITY)
            gap, d = np.abs(driven["position_gap"][:, 0]), np.abs(driven["lateral_error"][:, 0])
            sideslip = np.degrees(np.abs(driven["sideslip"]).max())
            rows.append(
                (
                    f"{friction:g}",
                    f"{braking:g}",
                    f"{used.max():.2f}",
                    f"{gap.max():.2f}",
                    f"{d.max():.2f}",
                    f"{sideslip:.1f}",
                )
            )
            if braking in (0.0, 4.0):
                runs[f"friction {friction:g}, {f'braking {braking:g} m/s²' if braking else 'without braking'}"] = driven
    found.pictures["braking_in_a_swerve.png"] = plots.braking_in_a_swerve(runs)
    found.tables.append(
        Table(
            "Figure 8's path behind a set position that brakes: what friction does not leave is lost along the path,"
            " and the car does not spin",
            (
                "friction",
                "braking [m/s²]",
                "largest part of the friction",
                "farthest from the set position [m]",
                "largest lateral error [m]",
                "largest sideslip [°]",
            ),
            tuple(rows),
        )
    )
