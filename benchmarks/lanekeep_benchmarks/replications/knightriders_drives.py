"""Team KnightRiders 2017: all controllers in all units, on a measured yaw rate, and on the filter that they ask for."""

from __future__ import annotations

import control
import numpy as np

from lanekeep_baselines.wall_cascade import (
    RATE_ZERO,
    delayed_rate_locus,
    published_rate_loop_gain,
    redesigned_loop_gains,
)
from lanekeep_baselines.wall_design import closed_poles
from lanekeep_baselines.wall_estimator import WallNoise
from lanekeep_benchmarks.replications import knightriders_plots as plots
from lanekeep_benchmarks.replications.knightriders_plots import Column
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_benchmarks.replications.wall_simulation import (
    CAR,
    CONTROLLERS,
    DEGREE,
    STARTS,
    VARIANTS,
    Run,
    Start,
    at_limit,
    kinematic_plant,
    linear_plant,
    lowest_after_peak,
    settled,
    simulate,
    simulate_estimated,
)

CALLED = {
    "pi": "PI",
    "pi-state": "PI state feedback",
    "cascade": "cascade, loop solved",
    "cascade-delayed": "cascade, one sample late",
    "cascade-redesigned": "cascade, redesigned",
    "pd": "PD",
    "pd-misprinted": "PD as misprinted",
}


def start_text(start: Start) -> str:
    """Place and heading of a start in words."""
    return f"{start[0]} m, {start[1]:.0f}°".replace("-", "−")


def comparison(found: Replication) -> None:
    """Every controller in the authors' mixed units, as driven and in radians; the last two on the nonlinear car."""
    rows, panels = [], []
    for start in STARTS:
        called = f"{start_text(start)}, {start[2]:g} m/s"
        runs: dict[str, dict[str, Run]] = {variant: {} for variant in VARIANTS}
        for name in CONTROLLERS:
            for variant in VARIANTS:
                if name == "cascade-redesigned" and variant != "si":
                    continue
                run = simulate(name, variant, start)
                runs[variant][name] = run
                numbers = (run.distance.max(), lowest_after_peak(run), run.distance.min(), settled(run))
                rows.append(
                    (called, CALLED[name], variant, *(f"{number:.2f}" for number in numbers), f"{at_limit(run):.0f}")
                )
        panels.append((called, runs))
    headings = (
        "start",
        "controller",
        "variant",
        "largest distance [m]",
        "smallest after it [m]",
        "smallest [m]",
        "largest error in the last 5 s [m]",
        "steering at its limit [%]",
    )
    title = "Every controller from the report's starts, 20 s, sensor's distance, asked for 1 m, wall at 0"
    found.tables.append(Table(title, headings, tuple(rows)))
    found.pictures["comparison.png"] = plots.comparison(panels, CALLED)
    (_, driven), _ = panels
    run = driven["si"]["pi"]
    rear = run.distance - CAR.sensor * np.sin(np.deg2rad(run.heading))
    peak = float(driven["si"]["cascade"].distance.max())
    source = "start 0.8 m, 20°, 0.4 m/s, checked"
    found.rows.append(Row("peak of the PI in radians, rear axle", source, 1.10, float(rear.max()), "m", 2))
    found.rows.append(Row("peak of the cascade in radians, k2 = 2", source, 1.00, peak, "m", 2))
    # Winds up and diverges: on the linear plant swings grow, on the car the steering stays at its limit.
    linear = simulate("pi-state", "si", STARTS[0], plant=linear_plant(CAR, STARTS[0][2]), duration=40.0).distance
    swings = [float(np.abs(part - 1.0).max()) for part in np.array_split(linear, 4)]
    car = driven["si"]["pi-state"]
    found.tables.append(
        Table(
            "PI state feedback in radians, poles 0.7, 0.8, 0.9, from 0.8 m, 20°, 0.4 m/s: winds up and diverges",
            ("plant", "what happens"),
            (
                ("linear", f"largest error of four times 10 s: {', '.join(f'{swing:.1f}' for swing in swings)} m"),
                ("car", f"at the limit {at_limit(car):.0f} %, heading up to {np.abs(car.heading).max():.0f}°"),
            ),
        )
    )


def one_sample(found: Replication) -> None:
    """The inner loop closed on a measured yaw rate: as published it chatters, as redesigned it does not."""
    start, late = STARTS[0], "cascade-delayed"
    plants = {"linear plant": linear_plant(CAR, start[2]), "car": kinematic_plant(CAR, start[2])}
    loop, (gain, *_) = published_rate_loop_gain(), redesigned_loop_gains()
    poles = {
        "cascade": abs(closed_poles(control.zpk([RATE_ZERO], [1.0], loop, CAR.step))).max(),
        late: abs(closed_poles(delayed_rate_locus(loop, RATE_ZERO, CAR.step))).max(),
        "cascade-redesigned": abs(closed_poles(delayed_rate_locus(gain, 0.0, CAR.step))).max(),
    }
    rows, columns, busy = [], [], 0.0
    for name, pole in poles.items():
        runs = {called: simulate(name, "si", start, plant=plant) for called, plant in plants.items()}
        columns.append(Column(CALLED[name], {"": runs["car"]}, until=8.0))
        for plant, run in runs.items():
            share, change = at_limit(run), np.abs(np.diff(run.steering[-100:])).max()
            beyond = 1000.0 * max(0.0, run.distance.max() - 1.0)
            cells = (f"{pole:.2f}", f"{share:.0f}", f"{beyond:.1f}", f"{1000.0 * settled(run):.1f}", f"{change:.2f}")
            rows.append((CALLED[name], plant, *cells))
            if (name, plant) == (late, "linear plant"):
                busy = share
    quantity = "time at the steering limit, published cascade one sample late"
    found.rows.append(Row(quantity, "linear plant in radians, checked", 92.0, busy, "%", 0))
    found.tables.append(
        Table(
            "The cascade's yaw rate, solved within the sample and one sample late (radians; 0.8 m, 20°, 0.4 m/s)",
            (
                "cascade",
                "plant",
                "largest pole of the inner loop",
                "steering at its limit [%]",
                "overshoot [mm]",
                "largest error in the last 5 s [mm]",
                "largest change of the steering a sample, last 100 [°]",
            ),
            tuple(rows),
        )
    )
    found.pictures["one_sample_late.png"] = plots.responses(
        "The algebraic loop: the cascade solved as in the report's simulation, on a measured yaw rate, and redesigned"
        " (car, radians)",
        columns,
    )


def kalman_filter(found: Replication) -> None:
    """What the authors ask for: the cascade on a filter that finds heading and biases; their PD beside it."""
    noise, offset, bias, last = WallNoise(), 3.0, 0.05, 10.0
    rows, columns = [], []
    for speed in (0.4, 1.0, 2.0):
        car = kinematic_plant(CAR, speed, offset * DEGREE)
        for start in ((1.0, 0.0, speed), (0.8, 20.0, speed), (0.5, -20.0, speed)):
            runs = {
                "cascade on the filter": simulate_estimated(
                    start, steering_offset=offset, yaw_rate_bias=bias, noise=noise
                ),
                "PD as driven": simulate("pd", "as-driven", start, plant=car, duration=30.0, noise=noise),
            }
            if start[0] == 0.8:
                columns.append(Column(f"{speed:g} m/s", runs))
            for name, run in runs.items():
                late = run.distance[run.time >= run.time[-1] - last] - 1.0
                change = float(np.std(np.diff(run.steering[-200:])))
                cells = (f"{100.0 * settled(run, last=last):.1f}", f"{100.0 * late.mean():.1f}", f"{change:.2f}")
                rows.append((f"{speed:g}", start_text(start), name, *cells))
    found.tables.append(
        Table(
            f"Steering offset {offset:.0f}°, yaw-rate bias {bias} rad/s, noise of {100 * noise.side_distance:.0f} cm"
            f" and {noise.yaw_rate} rad/s: the last {last:.0f} s of 30",
            (
                "speed [m/s]",
                "start",
                "controller",
                "largest error [cm]",
                "mean error [cm]",
                "steering's change a sample, standard deviation [°]",
            ),
            tuple(rows),
        )
    )
    found.pictures["kalman_filter.png"] = plots.responses(
        f"From 0.8 m, 20°: steering offset {offset:.0f}°, yaw-rate bias {bias} rad/s, noisy side distance and yaw rate",
        columns,
        band=0.02,
    )
