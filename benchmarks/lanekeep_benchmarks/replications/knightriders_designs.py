"""Team KnightRiders 2017: poles, zeros and gains of the four approaches, beside the printed ones."""

from __future__ import annotations

import control
import numpy as np

from lanekeep_baselines.wall_cascade import (
    HEADING_LOOP_GAIN,
    RATE_ZERO,
    REAR_AXLE_POLE,
    delayed_rate_locus,
    heading_locus,
    published_rate_loop_gain,
)
from lanekeep_baselines.wall_design import (
    PD_SENSOR,
    PD_SPEED,
    closed_poles,
    misprinted_pd_design,
    pd_design,
    pd_locus,
    pi_design,
    state_gains,
    state_plant,
)
from lanekeep_benchmarks.replications.record import Replication, Row
from lanekeep_benchmarks.replications.wall_simulation import CAR, PD_CAR, STARTS


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
    for name, checked, reproduced in numbers:
        found.rows.append(Row(f"{name}, 0.4 m/s", "3.3.3, A.3, checked", checked, float(reproduced), "", 4))


def state_feedback(found: Replication) -> None:
    """Second approach: the closed form (17) and its prefilter (18), against pole placement."""
    gains = state_gains(CAR, 1.0)
    for name, checked, reproduced in zip("123", (14.4609, 1.8106, -1.0370), gains, strict=True):
        found.rows.append(Row(f"r{name} of the state feedback, 1 m/s", "(17), checked", checked, reproduced, "", 4))
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
    found.rows.append(Row("r1 that the poles ask for in radians, 0.4 m/s", "(17), checked", 52.57, asked, "rad/m", 2))


def cascade(found: Replication) -> None:
    """Third approach: gains and poles of the inner and the middle loop."""
    loop = published_rate_loop_gain()
    found.rows.append(Row("loop gain k v T/l of the yaw rate", "3.5.3, checked", 17.0, loop, "", 3))
    inner = closed_poles(control.zpk([RATE_ZERO], [1.0], loop, CAR.step))[0]
    found.rows.append(Row("closed pole of the yaw rate's loop", "3.5.3", 0.15, float(inner.real), "", 3))
    closed = (1.0 + RATE_ZERO * loop) / (1.0 + loop)
    found.rows.append(Row("pole p of (20)", "(20), checked", 0.15, closed, "", 3))
    again = published_rate_loop_gain(REAR_AXLE_POLE)
    source = "A.9: new value 2/3, checked"
    found.rows.append(Row("loop gain of the yaw rate for the listing's second pole", source, 0.588, again, "", 3))
    inner = closed_poles(control.zpk([RATE_ZERO], [1.0], again, CAR.step))[0]
    found.rows.append(Row("closed pole of the yaw rate's loop, second value", "A.9", 0.667, float(inner.real), "", 3))
    late = closed_poles(delayed_rate_locus(again, RATE_ZERO, CAR.step))
    for expected, pole in zip((0.524, -0.112), late.real, strict=True):
        name = f"closed pole {expected:g} of that loop one sample late".replace("-", "−")
        found.rows.append(Row(name, source, expected, float(pole), "", 3))
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
    for name, source, expected, reproduced, digits in (
        ("p1 of the PD with the misprinted gain", "3.6.2", -0.0321, printed[2].real, 4),
        ("p2, p3 of the PD with the misprinted gain, real part", "3.6.2", 0.9864, printed[0].real, 4),
        ("p2, p3 of the PD with the misprinted gain, imaginary part", "3.6.2", 0.0304, abs(printed[0].imag), 4),
        ("p1 of the PD in rad per metre, unstable", "(23), checked", -14.08, radians[2].real, 2),
        ("p1 of the PD in degrees per metre", "(23), checked", -0.149, degrees[2].real, 3),
        ("p2, p3 of the PD in degrees per metre, real part", "(23), checked", 0.9475, degrees[0].real, 4),
        ("p2, p3 of the PD in degrees per metre, imaginary part", "(23), checked", 0.0389, abs(degrees[0].imag), 4),
    ):
        found.rows.append(Row(f"{name}, {where}", source, expected, float(reproduced), "", digits))
