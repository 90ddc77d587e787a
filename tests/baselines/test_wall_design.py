"""Team KnightRiders 2017: the numbers of the control chapter, printed or worked out elsewhere, and what was added."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete

from lanekeep_baselines.wall_cascade import (
    LARGEST_HEADING,
    MODULUS_MARGIN,
    REAR_AXLE_POLE,
    STEERING_LIMIT,
    delayed_rate_locus,
    heading_locus,
    published_cascade,
    published_rate_loop_gain,
    redesigned_cascade,
    redesigned_loop_gains,
)
from lanekeep_baselines.wall_control import Cascade, Measured, Pd, Pi, PiState, PublishedCascade, WallControl
from lanekeep_baselines.wall_design import (
    PD_SENSOR,
    PD_SPEED,
    WallCar,
    bounded_pi_design,
    closed_poles,
    misprinted_pd_design,
    pd_design,
    pd_locus,
    pi_design,
    pi_poles,
    state_gains,
    state_plant,
)

CAR = WallCar()
SPEEDS = (0.3, 0.4, 1.0, 2.0)


# --- the plant


@pytest.mark.parametrize("speed", SPEEDS)
def test_the_discrete_plant_is_the_continuous_one_held(speed: float) -> None:
    a, b = np.array([[0.0, speed], [0.0, 0.0]]), np.array([[speed * 0.175 / 0.35], [speed / 0.35]])
    held = cont2discrete((a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1))), 0.045)
    np.testing.assert_allclose(CAR.plant(speed)[0], held[0], atol=1e-15)
    np.testing.assert_allclose(CAR.plant(speed)[1], held[1], atol=1e-15)
    # (3) as it must read: (v l_H/l) (s + v/l_H)/s²; the printed one has a single pole at -l_H.
    correct = control.zpk([-speed / 0.175], [0.0, 0.0], speed * 0.175 / 0.35)
    theirs, ours = control.sample_system(correct, 0.045, "zoh"), CAR.transfer(speed)
    at = np.exp(1j * np.linspace(0.1, 3.0, 20))
    np.testing.assert_allclose(ours(at), theirs(at), rtol=1e-6)


def test_the_zero_of_the_plant() -> None:
    way = 2.0 * 0.045
    assert CAR.zero(2.0) == pytest.approx((0.35 - way) / (0.35 + way))
    np.testing.assert_allclose(WallCar(sensor=0.0).zero(np.array(SPEEDS)), -1.0)


# --- first approach: PI by root locus


def test_the_pi_at_0_4_metres_per_second() -> None:
    design = pi_design(CAR, 0.4)
    assert CAR.zero(0.4) == pytest.approx(0.9022, abs=5e-5)
    assert design.zero == pytest.approx(0.8533, abs=5e-5)
    assert design.breakaway == pytest.approx(0.6260, abs=5e-5)
    assert design.loop_gain == pytest.approx(0.8361, abs=5e-5)
    loop = control.zpk([float(design.zero)], [1.0], float(design.gain), CAR.step) * CAR.transfer(0.4)
    np.testing.assert_allclose(closed_poles(loop), [0.9144, 0.6485, 0.6010], atol=5e-5)


@pytest.mark.parametrize("speed", SPEEDS)
def test_two_branches_of_the_pi_locus_meet_at_the_breakaway_point(speed: float) -> None:
    design = pi_design(CAR, speed)
    n2, n3, point = float(design.zero), float(CAR.zero(speed)), float(design.breakaway)
    loop = control.zpk([n2, n3], [1.0, 1.0, 1.0], 1.0, CAR.step)
    gain = abs((point - 1.0) ** 3 / ((point - n2) * (point - n3)))
    # A double pole moves by the root of an error: 1e-7 for rounding's 1e-15.
    np.testing.assert_allclose(sorted(abs(closed_poles(loop, gain) - point))[:2], 0.0, atol=1e-5)
    assert np.all(abs(closed_poles(loop, float(design.loop_gain)).imag) < 1e-9)


@pytest.mark.parametrize(
    "car", [CAR, WallCar(0.258, 0.129), WallCar(sensor=0.14)], ids=["knightriders", "pses", "0.14"]
)
@given(speed=st.floats(0.2, 3.0))
def test_no_pole_of_the_bounded_pi_is_left_of_zero_at_any_speed(car: WallCar, speed: float) -> None:
    """Poles of the loop that python-control closes, not those that the design names."""
    design = bounded_pi_design(car, speed)
    loop = control.zpk([float(design.zero)], [1.0], float(design.gain), car.step) * car.transfer(speed)
    poles = control.feedback(loop, 1).poles()
    assert len(poles) == 3 and poles.real.min() > 0.09 and abs(poles).max() < 1.0
    np.testing.assert_allclose(np.sort(pi_poles(car, speed, design)), np.sort(poles), atol=1e-6)


def test_the_published_pi_breaks_the_reports_rule_and_is_unstable() -> None:
    pses = WallCar(0.258, 0.129)
    assert pi_poles(CAR, 1.2, pi_design(CAR, 1.2)).real.min() < 0.0
    assert abs(pi_poles(pses, 2.0, pi_design(pses, 2.0))).max() == pytest.approx(1.0023, abs=1e-4)


def test_up_to_where_it_keeps_the_rule_the_bounded_pi_is_the_published_one() -> None:
    speeds = np.array([0.2, 0.4, 0.7, 1.0])
    for bounded, published in zip(
        vars(bounded_pi_design(CAR, speeds)).values(), vars(pi_design(CAR, speeds)).values(), strict=True
    ):
        np.testing.assert_array_equal(bounded, published)


# --- second approach: state feedback by Ackermann


def test_equation_17_at_one_metre_per_second() -> None:
    np.testing.assert_allclose(state_gains(CAR, 1.0), [14.4609, 1.8106, -1.0370], atol=5e-5)


@pytest.mark.parametrize("sensor", [0.14, 0.175])
@pytest.mark.parametrize("poles", [(0.7, 0.8, 0.9), (0.5, 0.85, 0.95)])
@pytest.mark.parametrize("speed", SPEEDS)
def test_equation_17_is_pole_placement(speed: float, poles: tuple[float, float, float], sensor: float) -> None:
    car = WallCar(sensor=sensor)
    np.testing.assert_allclose(
        state_gains(car, speed, poles), np.ravel(control.acker(*state_plant(car, speed), poles)), rtol=1e-6
    )


def test_the_prefilter_is_r1() -> None:
    a, b = CAR.plant(0.7)
    r = state_gains(CAR, 0.7)[None, :2]
    inverse = np.array([[1.0, 0.0]]) @ np.linalg.inv(np.eye(2) - a + b @ r) @ b
    assert 1.0 / inverse[0, 0] == pytest.approx(r[0, 0])


def test_in_radians_the_poles_ask_for_52_radians_per_metre() -> None:
    assert state_gains(CAR, 0.4)[0] == pytest.approx(52.0, abs=1.0)


def test_gains_are_elementwise() -> None:
    speeds = np.array(SPEEDS)
    np.testing.assert_array_equal(state_gains(CAR, speeds), np.stack([state_gains(CAR, v) for v in SPEEDS]))
    np.testing.assert_array_equal(pi_design(CAR, speeds).gain, [pi_design(CAR, v).gain for v in SPEEDS])
    redesign = redesigned_cascade(CAR, speeds).distance_gain
    np.testing.assert_array_equal(redesign, [redesigned_cascade(CAR, v).distance_gain for v in SPEEDS])


# --- third approach: the cascade


def test_loop_gains_and_poles_of_the_published_cascade() -> None:
    assert published_rate_loop_gain() == pytest.approx(17.0)
    inner = control.zpk([0.1], [1.0], 17.0, CAR.step)
    np.testing.assert_allclose(closed_poles(inner), [0.15], atol=1e-12)
    poles = closed_poles(heading_locus(CAR.step), 0.556)
    np.testing.assert_allclose(poles.real, 0.297, atol=5e-4)
    np.testing.assert_allclose(abs(poles.imag), 0.079, atol=5e-4)
    design = published_cascade(CAR, 0.6, 4.0)
    assert design.rate_gain == pytest.approx(17.0 * 0.35 / (0.6 * 0.045)) and design.rate_zero == 0.1
    assert design.heading_gain * 17.0 / 18.0 == pytest.approx(0.556)


def test_with_one_sample_of_delay_the_published_inner_loop_is_unstable() -> None:
    assert abs(closed_poles(delayed_rate_locus(17.0, 0.1, CAR.step))).max() > 16.0
    limit = 2.0 / 1.1  # z² - (1 - K) z - 0.1 K at z = -1
    assert abs(closed_poles(delayed_rate_locus(0.999 * limit, 0.1, CAR.step))).max() < 1.0
    assert abs(closed_poles(delayed_rate_locus(1.001 * limit, 0.1, CAR.step))).max() > 1.0


def test_the_listings_second_inner_pole_does_not_chatter() -> None:
    """A.9's new value 2/3: |2/3 - 1|/|2/3 - 0.1|; z² - (1 - K) z - 0.1 K with one sample of delay."""
    gain = published_rate_loop_gain(REAR_AXLE_POLE)
    assert gain == pytest.approx(10.0 / 17.0)
    np.testing.assert_allclose(closed_poles(control.zpk([0.1], [1.0], gain, CAR.step)), [2.0 / 3.0], atol=1e-12)
    np.testing.assert_allclose(closed_poles(delayed_rate_locus(gain, 0.1, CAR.step)), [0.524, -0.112], atol=5e-4)


def test_rules_of_the_redesign() -> None:
    rate, heading, distance = redesigned_loop_gains()
    inner = delayed_rate_locus(rate, 0.0, CAR.step)
    np.testing.assert_allclose(sorted(closed_poles(inner).real), [0.0, 1.0 - rate], atol=1e-12)
    around = np.exp(1j * np.linspace(1e-3, np.pi, 4000))
    assert abs(1.0 + inner(around)).min() == pytest.approx(MODULUS_MARGIN, abs=1e-6)
    # One more sample: z² - z + K.
    pole = np.log(np.roots([1.0, -1.0, rate])[0])
    assert -pole.real / abs(pole) == pytest.approx(0.40, abs=5e-3)
    # Heading: the rate over a step, measured after it, adds up; poles meet on the positive real axis.
    middle = control.zpk([0.0], [1.0, 1.0 - rate], heading * rate, CAR.step)
    np.testing.assert_allclose(closed_poles(middle), np.sqrt(1.0 - rate), atol=1e-6)
    outer = control.minreal(control.feedback(middle, 1), verbose=False) * control.zpk([-1.0], [1.0], 0.5, CAR.step)
    poles = closed_poles(outer, 0.9999 * distance)
    assert abs(poles.imag).max() < 1e-6 and poles.real.min() > 0.0
    assert abs(closed_poles(outer, 1.01 * distance).imag).max() > 1e-3


def test_largest_curvature_leaves_room() -> None:
    design = redesigned_cascade(CAR, np.array(SPEEDS))
    asked = design.distance_gain * np.sin(LARGEST_HEADING)
    assert np.all(asked <= 0.5 * np.tan(STEERING_LIMIT) / 0.35 + 1e-12)


# --- the competition's PD


def test_poles_of_the_pd() -> None:
    car = WallCar(sensor=PD_SENSOR)
    printed = closed_poles(pd_locus(car, PD_SPEED, misprinted_pd_design()))
    np.testing.assert_allclose(printed[2], -0.0321, atol=5e-5)
    np.testing.assert_allclose(printed[:2].real, 0.9864, atol=5e-5)
    np.testing.assert_allclose(abs(printed[:2].imag), 0.0304, atol=5e-5)
    radians = closed_poles(pd_locus(car, PD_SPEED, pd_design()))
    assert radians[2].real == pytest.approx(-14.08, abs=5e-3)
    degrees = closed_poles(pd_locus(car, PD_SPEED, pd_design()), np.pi / 180.0)
    np.testing.assert_allclose(degrees[2], -0.149, atol=5e-4)
    np.testing.assert_allclose(degrees[:2].real, 0.9475, atol=5e-5)
    np.testing.assert_allclose(abs(degrees[:2].imag), 0.0389, atol=5e-5)


def test_gain_of_the_pd_is_equation_23() -> None:
    """u_k = K_P e + K_D/T (e_k - e_before): (T K_P + K_D)/T times e_k, minus K_D/T times e_before."""
    design = pd_design()
    assert design.gain == pytest.approx(15.0 + 15.0 / 0.045)
    assert design.gain * design.zero == pytest.approx(15.0 / 0.045)
    assert misprinted_pd_design().gain == pytest.approx(1.0 / (0.045 * (0.045 * 15.0 + 15.0)))


# --- rows


def controls() -> list[WallControl]:
    limit = STEERING_LIMIT
    return [
        Pi(CAR, limit),
        Pi(CAR, limit, bounded=True),
        PiState(CAR, limit),
        PublishedCascade(CAR, limit, 2.0),
        PublishedCascade(CAR, limit, 2.0, delayed=True),
        Cascade(CAR, limit, LARGEST_HEADING),
        Pd(CAR, limit, pd_design()),
    ]


@pytest.mark.parametrize("which", range(7))
def test_rows_of_controllers_are_independent_and_nothing_is_mutated(which: int) -> None:
    rng, rows = np.random.default_rng(2), 37
    at = Measured(rng.uniform(0.3, 2.0, rows), *rng.uniform(-0.5, 1.0, (3, rows)))
    goal, memory, fresh = np.ones(rows), rng.uniform(-0.3, 0.3, (rows, 1)), rng.random(rows) < 0.3
    kept, policy = memory.copy(), controls()[which]
    steering, after = policy.command(at, goal, memory, fresh)
    assert after.shape == (rows, 1) and np.all(abs(steering) <= STEERING_LIMIT)
    np.testing.assert_array_equal(memory, kept)
    for i in range(rows):
        one = slice(i, i + 1)
        alone = policy.command(Measured(*(value[one] for value in at)), goal[one], memory[one], fresh[one])
        np.testing.assert_array_equal(alone[0], steering[one])
        np.testing.assert_array_equal(alone[1], after[one])
