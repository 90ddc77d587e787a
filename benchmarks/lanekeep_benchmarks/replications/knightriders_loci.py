"""Team KnightRiders 2017: the root loci of its figures, and of the loops for one sample of delay."""

from __future__ import annotations

import control
import numpy as np

from lanekeep_baselines.wall_cascade import (
    DISTANCE_GAIN_DEGREES,
    DISTANCE_GAIN_SPEED,
    HEADING_LOOP_GAIN,
    RATE_ZERO,
    REAR_AXLE_POLE,
    delayed_rate_locus,
    heading_locus,
    published_rate_loop_gain,
    redesigned_loop_gains,
)
from lanekeep_baselines.wall_design import (
    PD_SPEED,
    WallCar,
    misprinted_pd_design,
    pd_design,
    pd_locus,
    pi_design,
)
from lanekeep_benchmarks.replications import knightriders_plots as plots
from lanekeep_benchmarks.replications.knightriders_plots import Locus
from lanekeep_benchmarks.replications.record import Replication
from lanekeep_benchmarks.replications.wall_simulation import CAR, PD_CAR, STARTS

#: The cascade's listing has another sensor and speed than its figures.
LISTED_CAR, LISTED_SPEED = WallCar(sensor=0.14), 0.6


def root_loci(found: Replication) -> None:
    """Figures 3.6, 3.7, 3.22, 3.24, 3.27 to 3.29 and 3.39; and the loops for one sample of delay."""
    step, speed = CAR.step, STARTS[0][2]
    design, n3 = pi_design(CAR, speed), float(CAR.zero(speed))
    n2, beside, rate = float(design.zero), (1.0 - float(CAR.zero(speed))) / 2.0, published_rate_loop_gain()
    # The closed heading loop (21); the distance at the sensor, (22) with its zero
    # as it must be, (l_H - v T/2)/(l_H + v T/2), and at the rear axle.
    heading = control.minreal(control.feedback(HEADING_LOOP_GAIN * heading_locus(step), 1), verbose=False)
    way = LISTED_SPEED * step
    arm = LISTED_CAR.sensor + way / 2.0
    sensor = heading * control.zpk([(LISTED_CAR.sensor - way / 2.0) / arm], [1.0], arm, step)
    rear = heading * control.zpk([-1.0], [1.0], way / 2.0, step)
    k2 = DISTANCE_GAIN_DEGREES * DISTANCE_GAIN_SPEED / LISTED_SPEED
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
    again = published_rate_loop_gain(REAR_AXLE_POLE)
    middle = control.zpk([0.0], [1.0, 1.0 - rate_gain], rate_gain, step)
    outer = control.minreal(control.feedback(heading_gain * middle, 1), verbose=False)
    outer = outer * control.zpk([-1.0], [1.0], 0.5, step)
    found.pictures["root_loci_one_sample_late.png"] = plots.root_loci(
        "With the yaw rate one sample late: the published inner loop, and the redesign",
        [
            Locus("yaw rate as published", delayed_rate_locus(1.0, RATE_ZERO, step), {f"K = {rate:.0f}": rate}),
            Locus(
                "yaw rate, A.9's second value 2/3",
                delayed_rate_locus(1.0, RATE_ZERO, step),
                {f"K = {again:.3f}": again},
            ),
            Locus("yaw rate, zero at 0", delayed_rate_locus(1.0, 0.0, step), {f"K = {rate_gain:g}": rate_gain}),
            Locus("heading", middle, {f"k₁ = {heading_gain:.3f}": heading_gain}),
            Locus("distance", outer, {f"k₂ v T = {distance_gain:.3f}": distance_gain}),
        ],
    )
