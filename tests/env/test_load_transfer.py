"""What load transfer and combined slip make of an axle's tyres, against wheels taken one by one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from two_track_oracle import TwoTrack, tyre

from lanekeep_env.physics import load_transfer
from lanekeep_env.physics.parameters import SteeringActuator
from lanekeep_env.physics.vehicles import VEHICLES

PASSAT = replace(VEHICLES["passat"], steering=SteeringActuator())


def settings_of(car):
    return load_transfer.read(load_transfer.numbers_of(car))


def body(car, friction=1.0):
    load = friction * car.mass * 9.81 / car.wheelbase
    axles = car.cg_to_front_axle, car.cg_to_rear_axle, 1.0 / car.mass, 1.0 / car.yaw_inertia
    stiffness = car.front_cornering_stiffness, car.rear_cornering_stiffness
    return (*axles, *stiffness, load * car.cg_to_rear_axle, load * car.cg_to_front_axle, None)


@pytest.mark.parametrize("pull, across", [(0.0, 0.0), (0.0, 6.0), (-5.0, -3.0), (4.0, 7.0)])
def test_axles_are_the_sum_of_their_wheels(pull, across):
    """Peaks and stiffnesses without the circle, wheel by wheel from the loads of a rigid car."""
    car, oracle = PASSAT, TwoTrack(PASSAT, 1.0)
    loaded = load_transfer.on_loads(body(car), 1.0, body(car)[6:8], pull, across, settings_of(car))
    moved = car.mass * pull * car.height / car.wheelbase
    for axle, (along, share) in enumerate(((-moved, car.front_roll_stiffness), (moved, 1 - car.front_roll_stiffness))):
        sideways = share * car.mass * across * car.height / car.track
        loads = [oracle.loads[axle] + 0.5 * along + sign * sideways for sign in (1, -1)]
        peak = sum(oracle.wheel(axle, math.tan(math.pi / 3) * 1e3, load) for load in loads)  # far beyond any slip
        slope = sum(oracle.wheel(axle, 1e-7, load) / 1e-7 for load in loads)
        assert loaded[4 + axle] == pytest.approx(slope, rel=1e-6)
        # 1.5 atan(infinity) is past the peak: sin(3 pi / 4)
        assert loaded[6 + axle] * math.sin(0.75 * math.pi) == pytest.approx(peak, rel=1e-3)


@pytest.mark.parametrize("name", ["yin", "van", "f1tenth"])
@pytest.mark.parametrize("factor, friction", [(1.0, 1.0), (1.3, 0.6), (1.0, 3.0)])
def test_tyres_bear_what_their_wheels_bear(name, factor, friction):
    """Axle by axle the acceleration at which both wheels' peaks are the axle's share of the mass."""
    car = VEHICLES[name]

    def left_over(across, axle):
        base, arms = car.wheelbase, (car.cg_to_rear_axle, car.cg_to_front_axle)
        rest, share = (
            0.5 * car.mass * 9.81 * arms[axle] / base,
            (car.front_roll_stiffness, 1 - car.front_roll_stiffness),
        )
        moved = min(share[axle] * factor * car.mass * across * car.height / car.track, factor * rest)
        peaks = [
            friction * load * (1.0 - car.friction_load_sensitivity * (load / rest - 1.0))
            for load in (factor * rest - moved, factor * rest + moved)
        ]
        return sum(peaks) - factor * car.mass * arms[axle] / base * across

    expected = min(brentq(left_over, 0.1, 9.81 * friction + 1.0, args=(axle,)) for axle in (0, 1))
    assert load_transfer.largest_across(car, 9.81 * friction, factor) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 0.94])
def test_combined_slip_is_that_of_similar_tyres(share):
    """A tyre that gives ``share`` of its friction along, its force against its slip: at small slip, and at much."""
    car = replace(PASSAT, cg_height=0.0, friction_load_sensitivity=0.0, stiffness_load_sensitivity=0.0)
    numbers = load_transfer.braked(body(car), None, -share * 9.81, 0.0, settings_of(car))
    peak, stiffness = body(car)[6], body(car)[4]

    def across(slip):
        """Lateral force where the longitudinal slip is as large as it takes."""

        def missing(along):
            total = math.hypot(along, slip)
            return tyre(total, stiffness, peak) * along / total - share * peak

        most = math.tan(math.pi / 3) * 1.5 * peak / stiffness  # slip of the peak
        along = brentq(missing, 1e-9, math.sqrt(max(most**2 - slip**2, 1e-18)))
        total = math.hypot(along, slip)
        return tyre(total, stiffness, peak) * slip / total

    assert tyre(1e-5, numbers[4], numbers[6]) == pytest.approx(across(1e-5), rel=0.015)
    largest = max(across(slip) for slip in np.linspace(0.0, 1.0, 400) if reachable(slip, stiffness, peak, share))
    assert numbers[6] == pytest.approx(largest, rel=0.02)
    for slip in (0.01, 0.02, 0.03):
        if reachable(slip, stiffness, peak, share):
            assert tyre(slip, numbers[4], numbers[6]) == pytest.approx(across(slip), rel=0.12)


def reachable(slip, stiffness, peak, share):
    """Whether a tyre with this lateral slip can still give ``share`` of its friction along below its peak."""
    most = math.tan(math.pi / 3) * 1.5 * peak / stiffness
    return slip < most * math.sqrt(1.0 - share**2) * 0.999


@pytest.mark.parametrize("pull", [-6.0, 0.0, 3.0])
def test_a_powertrain_leaves_the_same_tyres(pull):
    """Drive's own circle has taken its part of the peaks before: the rest is the same."""
    car, settings = body(PASSAT), settings_of(PASSAT)
    left = math.sqrt(1.0 - (pull / 9.81) ** 2)
    taken = (*car[:6], car[6] * left, car[7] * left, None)
    driven = load_transfer.driven(taken, car[6], pull, 5.0, settings)
    braked = load_transfer.braked(car, None, pull, 5.0, settings)
    np.testing.assert_allclose(driven[:8], braked[:8], rtol=1e-12)
    assert driven[9] == pytest.approx(braked[9], rel=1e-12) and driven[9] > 0.0
