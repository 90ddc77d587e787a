"""Team KnightRiders 2017, chapter 3: the controllers along a wall, designed and simulated again.

The report prints the cascade's poles and gains and the poles of the PD; its responses are curves. "Checked" numbers
were recomputed from its equations and listings by others than the authors of this code. Units: `wall_simulation`.

Distances are the side sensor's. The report says of Figures 3.33 to 3.38 that theirs is the rear axle's, which cannot be
meant in their mixed units: from a start of (0.8, 20) it would be -2.7.
"""

from __future__ import annotations

import control
import numpy as np

from lanekeep_baselines.wall_cascade import (
    HEADING_LOOP_GAIN,
    RATE_POLE,
    RATE_ZERO,
    delayed_rate_locus,
    heading_locus,
    published_rate_loop_gain,
    redesigned_loop_gains,
)
from lanekeep_baselines.wall_design import (
    PD_SENSOR,
    PD_SPEED,
    WallCar,
    closed_poles,
    misprinted_pd_design,
    pd_design,
    pd_locus,
    pi_design,
    state_gains,
    state_plant,
)
from lanekeep_baselines.wall_estimator import WallNoise
from lanekeep_baselines.wall_simulation import (
    CONTROLLERS,
    DISTANCE_GAIN,
    LIMIT,
    VARIANTS,
    Run,
    figure,
    settled,
    simulate,
    simulate_estimated,
)
from lanekeep_benchmarks.replications import knightriders_plots as plots
from lanekeep_benchmarks.replications.knightriders_plots import Column, Locus
from lanekeep_benchmarks.replications.record import Replication, Row, Table

CAR = WallCar()
#: The cascade's listing has another sensor and speed than its figures; the PD's are those of its printed poles.
LISTED_CAR, LISTED_SPEED = WallCar(sensor=0.14), 0.6
PD_CAR = WallCar(sensor=PD_SENSOR)
#: Starts of the report's comparisons: distance in m, heading in degrees, speed in m/s.
STARTS = ((0.8, 20.0, 0.4), (0.5, -20.0, 1.0))
CALLED = {
    "pi": "PI",
    "pi-state": "PI state feedback",
    "cascade": "cascade, loop solved",
    "cascade-delayed": "cascade, one sample late",
    "cascade-redesigned": "cascade, redesigned",
    "pd": "PD",
    "pd-misprinted": "PD as misprinted",
}


def at_limit(run: Run) -> float:
    """Share of the time with the steering at its limit, %."""
    return 100.0 * float(np.mean(np.abs(run.steering) > LIMIT - 1e-6))


def lowest_after_peak(run: Run) -> float:
    """Smallest distance behind the largest one, m."""
    return float(run.distance[run.distance.argmax() :].min())


def start_text(distance: float, heading: float) -> str:
    """A start in words."""
    return f"{distance} m, {heading:.0f}°".replace("-", "−")


def pi(found: Replication) -> None:
    """First approach at 0.4 m/s: zero, breakaway point, gain, poles."""
    speed, design = STARTS[0][2], pi_design(CAR, STARTS[0][2])
    numbers = [
        ("zero n3 of the plant", 0.9022, CAR.zero(speed)),
        ("zero n2 of the PI", 0.8533, design.zero),
        ("breakaway point of the PI's locus", 0.6260, design.breakaway),
        ("loop gain k of the PI", 0.8361, design.loop_gain),
    ]
    loop = control.zpk([float(design.zero)], [1.0], float(design.gain), CAR.step) * CAR.transfer(speed)
    printed = zip((0.9144, 0.6485, 0.6010), closed_poles(loop).real, strict=True)
    numbers += [(f"closed pole {k + 1} of the PI", *pair) for k, pair in enumerate(printed)]
    for name, published, reproduced in numbers:
        found.rows.append(Row(f"{name}, 0.4 m/s", "3.3.3, A.3, checked", published, float(reproduced), "", 4))


def state_feedback(found: Replication) -> None:
    """Second approach: the closed form (17) and its prefilter (18), against pole placement."""
    gains = state_gains(CAR, 1.0)
    for name, published, reproduced in zip("123", (14.4609, 1.8106, -1.0370), gains, strict=True):
        found.rows.append(Row(f"r{name} of the state feedback, 1 m/s", "(17), checked", published, reproduced, "", 4))
    a, b = CAR.plant(1.0)
    through = np.linalg.solve(np.eye(2) - a + b @ gains[None, :2], b)
    found.rows.append(Row("prefilter f = r1, 1 m/s", "(18), checked", 14.4609, 1.0 / float(through[0, 0]), "", 4))
    off = [
        np.abs(np.ravel(control.acker(*state_plant(CAR, speed), (0.7, 0.8, 0.9))) / state_gains(CAR, speed) - 1.0)
        for speed in (0.3, 0.4, 1.0, 2.0)
    ]
    quantity = "(17) against Ackermann's formula, largest relative difference, 0.3 to 2 m/s"
    found.rows.append(Row(quantity, "(17), checked", 0.0, float(np.max(off)), "", 6))
    asked = float(state_gains(CAR, 0.4)[0])
    found.rows.append(Row("r1 that the poles ask for in radians, 0.4 m/s", "(17), checked", 52.0, asked, "rad/m", 1))


def cascade(found: Replication) -> None:
    """Third approach: gains and poles of the inner and the middle loop."""
    loop = published_rate_loop_gain()
    found.rows.append(Row("loop gain k v T/l of the yaw rate", "3.5.3, checked", 17.0, loop, "", 3))
    inner = closed_poles(control.zpk([RATE_ZERO], [1.0], loop, CAR.step))[0]
    found.rows.append(Row("closed pole of the yaw rate's loop", "3.5.3", 0.15, float(inner.real), "", 3))
    closed = (1.0 + RATE_ZERO * loop) / (1.0 + loop)
    found.rows.append(Row("pole p of (20)", "(20), checked", 0.15, closed, "", 3))
    pole = closed_poles(heading_locus(CAR.step), HEADING_LOOP_GAIN)[0]
    source = "3.5.4, A.11 at loop gain 0.556, checked"
    found.rows.append(Row("closed poles of the heading's loop, real part", source, 0.297, float(pole.real)))
    found.rows.append(Row("closed poles of the heading's loop, imaginary part", source, 0.079, abs(float(pole.imag))))


def pd(found: Replication) -> None:
    """The competition's PD: poles from the misprinted gain, and from the correct one in rad and in degrees a metre."""
    where = f"{PD_SPEED} m/s, l_H = {PD_SENSOR} m"
    printed = closed_poles(pd_locus(PD_CAR, PD_SPEED, misprinted_pd_design()))
    correct = pd_locus(PD_CAR, PD_SPEED, pd_design())
    radians, degrees = closed_poles(correct), closed_poles(correct, np.pi / 180.0)
    for name, source, published, reproduced, digits in (
        ("p1 of the PD with the misprinted gain", "3.6.2", -0.0321, printed[2].real, 4),
        ("p2, p3 of the PD with the misprinted gain, real part", "3.6.2", 0.9864, printed[0].real, 4),
        ("p2, p3 of the PD with the misprinted gain, imaginary part", "3.6.2", 0.0304, abs(printed[0].imag), 4),
        ("p1 of the PD in rad per metre, unstable", "(23), checked", -14.08, radians[2].real, 2),
        ("p1 of the PD in degrees per metre", "(23), checked", -0.149, degrees[2].real, 3),
        ("p2, p3 of the PD in degrees per metre, real part", "(23), checked", 0.9475, degrees[0].real, 4),
        ("p2, p3 of the PD in degrees per metre, imaginary part", "(23), checked", 0.0389, abs(degrees[0].imag), 4),
    ):
        found.rows.append(Row(f"{name}, {where}", source, published, float(reproduced), "", digits))


def root_loci(found: Replication) -> None:
    """Figures 3.6, 3.7, 3.22, 3.24, 3.27 to 3.29 and 3.39; and the loops for one sample of delay."""
    step, speed = CAR.step, STARTS[0][2]
    design, n3 = pi_design(CAR, speed), float(CAR.zero(speed))
    n2, beside, rate = float(design.zero), (1.0 - float(CAR.zero(speed))) / 2.0, published_rate_loop_gain()
    # The closed heading loop (21); the distance at the sensor (22) and at the rear axle.
    heading = control.minreal(control.feedback(HEADING_LOOP_GAIN * heading_locus(step), 1), verbose=False)
    way = LISTED_SPEED * step
    arm = LISTED_CAR.sensor + way / 2.0
    sensor = heading * control.zpk([(LISTED_CAR.sensor - way / 2.0) / arm], [1.0], arm, step)
    rear = heading * control.zpk([-1.0], [1.0], way / 2.0, step)
    k2 = DISTANCE_GAIN["published"] * STARTS[0][2] / LISTED_SPEED
    gain = {f"k₂ = {k2:.2g}": k2}
    printed = pd_locus(PD_CAR, PD_SPEED, misprinted_pd_design())
    ratio = pd_design().gain / misprinted_pd_design().gain
    pd_gains = {"misprinted gain": 1.0, "correct, °/m": ratio * np.pi / 180.0, "correct, rad/m": ratio}
    pid = control.zpk([n3 - beside, n3, n3 + beside], [0.0, 1.0, 1.0, 1.0], 1.0, step)
    only_pi, pi_gain = control.zpk([n2, n3], [1.0, 1.0, 1.0], 1.0, step), float(design.loop_gain)
    inner = control.zpk([RATE_ZERO], [1.0], 1.0, step)
    pi_gains, near = {f"k = {pi_gain:.4f}": pi_gain}, (0.79, 1.05, -0.13, 0.13)
    found.pictures["root_loci.png"] = plots.root_loci(
        "Root loci (crosses and circles: open poles and zeros; filled: closed poles; grey: unit circle)",
        [
            Locus("Figure 3.6: PID, zeros around the plant's", pid),
            Locus("detail of 3.6", pid, shown=near),
            Locus("Figure 3.7: PI, 0.4 m/s", only_pi, pi_gains),
            Locus("detail of 3.7", only_pi, pi_gains, (0.54, 1.06, -0.26, 0.26)),
            Locus("Figure 3.22: yaw rate", inner, {f"k v T/l = {rate:.0f}": rate}),
            Locus("Figure 3.24: heading", heading_locus(step), {f"loop gain {HEADING_LOOP_GAIN}": HEADING_LOOP_GAIN}),
            Locus("Figure 3.27: distance of the sensor", sensor, gain),
            Locus("Figure 3.28: distance of the rear axle", rear, gain),
            Locus("Figure 3.29: detail of 3.28", rear, gain, (-0.05, 0.65, -0.35, 0.35)),
            Locus("Figure 3.39: PD, 1.8 m/s", printed, pd_gains),
            Locus("detail of 3.39", printed, pd_gains, (0.91, 1.01, -0.05, 0.05)),
        ],
    )
    rate_gain, heading_gain, distance_gain = redesigned_loop_gains()
    middle = control.zpk([0.0], [1.0, 1.0 - rate_gain], rate_gain, step)
    outer = control.minreal(control.feedback(heading_gain * middle, 1), verbose=False)
    outer = outer * control.zpk([-1.0], [1.0], 0.5, step)
    found.pictures["root_loci_one_sample_late.png"] = plots.root_loci(
        "With the yaw rate one sample late: the published inner loop, and the redesign",
        [
            Locus("yaw rate as published", delayed_rate_locus(1.0, RATE_ZERO, step), {f"K = {rate:.0f}": rate}),
            Locus("yaw rate, zero at 0", delayed_rate_locus(1.0, 0.0, step), {f"K = {rate_gain:g}": rate_gain}),
            Locus("heading", middle, {f"k₁ = {heading_gain:.3f}": heading_gain}),
            Locus("distance", outer, {f"k₂ v T = {distance_gain:.3f}": distance_gain}),
        ],
    )


def responses(found: Replication) -> None:
    """Figures 3.8 to 3.40 as the authors simulated them, in their mixed units."""
    runs = {
        number: figure(number)
        for number in ("3.8", "3.9", "3.10", "3.12", "3.13", "3.16", "3.17", "3.33", "3.35", "3.37", "3.40")
    }
    first, second = "0.4 m/s", "1 m/s"
    for name, title, columns in (
        (
            "figures_3_08_to_3_10.png",
            "First approach, PI, and the second for comparison",
            (
                ("3.8", "", f"PI, from 0 m, 0°, {first}", True),
                ("3.9", "", f"PI, from 0.8 m, 20°, {first}", True),
                ("3.10", "", f"PI state feedback, from 0.8 m, 20°, {first}", True),
            ),
        ),
        (
            "figures_3_12_to_3_19.png",
            "Second approach, PI state feedback, without and with a limited steering",
            (
                ("3.12", "3.14", f"from 0 m, 0°, {first}, no limit", False),
                ("3.13", "3.15", f"from 0 m, 0°, {first}, limited", True),
                ("3.16", "3.18", f"from 0.5 m, −20°, {second}, no limit", False),
                ("3.17", "3.19", f"from 0.5 m, −20°, {second}, limited", True),
            ),
        ),
        (
            "figures_3_33_to_3_40.png",
            f"Third approach, cascade (k₂ v = {0.4 * DISTANCE_GAIN['published']:g}/s, not printed), and the PD",
            (
                ("3.33", "3.34", f"cascade, from 0 m, 0°, {first}", True),
                ("3.35", "3.36", f"cascade, from 0.8 m, 20°, {first}", True),
                ("3.37", "3.38", f"cascade, from 0.5 m, −20°, {second}", True),
                ("3.40", "", f"PD as misprinted, step, {PD_SPEED} m/s", False),
            ),
        ),
    ):
        found.pictures[name] = plots.responses(
            f"{title} (metres and degrees mixed, as the authors simulated)",
            [
                Column(
                    f"Figure {above}: {what}",
                    {"": runs[above]},
                    limit,
                    f"Figure {below}" if below else "not shown in the report",
                    20.0 if above == "3.40" else 3.0,
                )
                for above, below, what, limit in columns
            ],
        )
    for quantity, number, published, reproduced in (
        ("peak of the PI", "3.9", 2.11, runs["3.9"].distance.max()),
        ("peak of the PI state feedback", "3.10", 1.44, runs["3.10"].distance.max()),
        ("lowest after it", "3.10", 0.62, lowest_after_peak(runs["3.10"])),
        ("peak of the cascade, k2 = 4", "3.35", 1.44, runs["3.35"].distance.max()),
        ("lowest after it", "3.35", 0.92, lowest_after_peak(runs["3.35"])),
    ):
        source = f"Figure {number}, checked"
        found.rows.append(Row(f"{quantity}, mixed units", source, published, float(reproduced), "m", 2))
    statements(found, runs)


def statements(found: Replication, runs: dict[str, Run]) -> None:
    """What the report says of its figures without a number."""

    def peaks(*numbers: str) -> str:
        return " / ".join(f"{runs[number].distance.max():.2f}" for number in numbers)

    def steering(*numbers: str) -> str:
        return " / ".join(f"{np.abs(runs[number].steering).max():.0f}°" for number in numbers)

    def seconds(*numbers: str) -> str:
        return " / ".join(f"{at_limit(runs[n]) / 100.0 * len(runs[n].time) * CAR.step:.2f} s" for n in numbers)

    def back(*numbers: str) -> str:
        return " / ".join(f"{runs[number].steering.min():.1f}°" for number in numbers).replace("-", "−")

    # Where the two poles of the heading's loop meet: (1 + p - k)² = 4 (p - n k).
    meet = min(np.roots([1.0, 4.0 * RATE_ZERO - 2.0 * (1.0 + RATE_POLE), (1.0 - RATE_POLE) ** 2]).real)
    found.tables.append(
        Table(
            "What the report says without a number, mixed units as the authors simulated",
            ("statement", "figures", "here"),
            (
                ("PI swings far over, state feedback less", "3.9 / 3.10", f"peaks {peaks('3.9', '3.10')} m"),
                ("cascade hardly", "3.35", f"peak {peaks('3.35')} m with k2 = 4 (not printed)"),
                ("state feedback asks for more than there is", "3.14 / 3.18", f"{steering('3.12', '3.16')} of 22°"),
                ("limited, it swings over", "3.13 / 3.17", f"peaks {peaks('3.13', '3.17')} m"),
                ("... more than without a limit", "3.12 / 3.16", f"peaks {peaks('3.12', '3.16')} m"),
                ("cascade does not swing over", "3.33 / 3.37", f"peaks {peaks('3.33', '3.37')} m"),
                ("its steering is soon within the limit", "3.34", f"{seconds('3.33')} at the limit"),
                (
                    "... and much smaller than the state feedback's",
                    "3.38 / 3.19",
                    f"{seconds('3.37', '3.17')} at the limit, back to {back('3.37', '3.17')}",
                ),
                ("PD with complex poles swings", "3.40", f"peak {peaks('3.40')} m"),
                (
                    "heading's poles are on the real axis beside the breakaway point",
                    "3.24",
                    f"they meet at a loop gain of {meet:.3f}; at 0.556 they have left the axis by 0.079",
                ),
            ),
        )
    )


def comparison(found: Replication) -> None:
    """Every controller in the authors' mixed units, as driven and in radians; the last two on the nonlinear car."""
    rows, panels = [], []
    for distance, heading, speed in STARTS:
        start = f"{start_text(distance, heading)}, {speed:g} m/s"
        runs: dict[str, dict[str, Run]] = {variant: {} for variant in VARIANTS}
        for name in CONTROLLERS:
            for variant in VARIANTS:
                if name == "cascade-redesigned" and variant != "si":
                    continue
                run = simulate(name, variant, (distance, heading), speed)
                runs[variant][name] = run
                numbers = (run.distance.max(), lowest_after_peak(run), run.distance.min(), settled(run))
                rows.append(
                    (start, CALLED[name], variant, *(f"{number:.2f}" for number in numbers), f"{at_limit(run):.0f}")
                )
        panels.append((start, runs))
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
    linear = simulate("pi-state", "si", (0.8, 20.0), 0.4, linear=True, duration=40.0).distance
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
    (distance, heading, speed), late = STARTS[0], "cascade-delayed"
    loop, (gain, *_) = published_rate_loop_gain(), redesigned_loop_gains()
    poles = {
        "cascade": abs(closed_poles(control.zpk([RATE_ZERO], [1.0], loop, CAR.step))).max(),
        late: abs(closed_poles(delayed_rate_locus(loop, RATE_ZERO, CAR.step))).max(),
        "cascade-redesigned": abs(closed_poles(delayed_rate_locus(gain, 0.0, CAR.step))).max(),
    }
    rows, columns, busy = [], [], 0.0
    for name, pole in poles.items():
        runs = {
            plant: simulate(name, "si", (distance, heading), speed, linear=plant == "linear plant")
            for plant in ("linear plant", "car")
        }
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
        for start in ((1.0, 0.0), (0.8, 20.0), (0.5, -20.0)):
            runs = {
                "cascade on the filter": simulate_estimated(
                    start, speed, steering_offset=offset, yaw_rate_bias=bias, noise=noise
                ),
                "PD as driven": simulate(
                    "pd", "as-driven", start, speed, duration=30.0, steering_offset=offset, noise=noise
                ),
            }
            if start == (0.8, 20.0):
                columns.append(Column(f"{speed:g} m/s", runs))
            for name, run in runs.items():
                late = run.distance[run.time >= run.time[-1] - last] - 1.0
                change = float(np.std(np.diff(run.steering[-200:])))
                cells = (f"{100.0 * settled(run, last=last):.1f}", f"{100.0 * late.mean():.1f}", f"{change:.2f}")
                rows.append((f"{speed:g}", start_text(*start), name, *cells))
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


STEPS = (
    ("first approach", pi),
    ("second approach", state_feedback),
    ("third approach", cascade),
    ("PD", pd),
    ("root loci", root_loci),
    ("responses", responses),
    ("comparison", comparison),
    ("one sample of delay", one_sample),
    ("Kalman filter", kalman_filter),
)
