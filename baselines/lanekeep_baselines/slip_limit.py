"""A safety filter around any policy that steers on tyres which saturate: slips are kept from the tyres' peaks.

A car whose rear tyres slip far beyond their peak spins, whatever is done about it then; one whose front tyres do so
runs wide. The filter lets a command pass unless it turns the car in faster than leads back. With the largest lateral
acceleration mu g and the peaks of slip p_f and p_r it asks, towards either side, for

    r <= mu g / v + (p_r - alpha_r) / T_s,     r' <= (that - r) / T_r,     alpha_f <= p_f.

The rear slip grows by r - a_y / v, so that the first keeps it from its peak (a control barrier function of second
order; at the peak it is the nullcline of sideslip, the edge of the envelope of Bobier and Gerdes, "Staying within the
nullcline boundary for vehicle envelope control using a sliding surface controller", Vehicle System Dynamics 51(2),
2013). The second is a force of the front axle, hence a slip, hence an angle of the road wheel. That is what may be
asked for: the actuator's lag takes slips beyond their peaks for a moment, by up to a half where full lock is asked for.

Nothing hidden is read: slips and forces of the axles are estimates of a Kalman filter of the nominal car, and friction
is the scenario's nominal one until they tell another. No tyre has to slide for that: the share of a linear tyre's
force that an axle gives falls with its slip, and tells how far its peak is. A car with softer tyres than the nominal
one seems to be on less friction. Axles bear their static loads here: with `tyre="load_sensitive"`, whose loads shift as
the car accelerates, the peaks are approximate.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_baselines.declared import PREFIX, Need
from lanekeep_baselines.lq import LinearQuadratic
from lanekeep_baselines.lq_design import Estimated, Weights
from lanekeep_baselines.lq_model import SIDESLIP, SLOWEST, STATES, STEER, YAW_RATE
from lanekeep_baselines.mpc import LimitedScenario
from lanekeep_baselines.policy import Floats
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.tyres import LINEAR_AT_PEAK, slip_at
from lanekeep_env.physics.tyres import MAGIC_FORMULA_SHAPE as SHAPE

#: T_s and T_r, s.
SLIP_TIME, TURN_TIME = 1.0, 0.125
#: Seconds after which a share 1/e is left of what was known of friction.
FADE = 5.0
#: Standard deviations of 1 / mu before anything is known, and of an axle's force over its stiffness in a step, rad.
SPREAD, DOUBT = 1.0, 0.03
#: Over B alpha of the magic formula: the share of a linear tyre's force, which rises here, and its slope.
_REACH: Floats = np.linspace(6.0, 0.02, 600)
_SHARE: Floats = np.sin(SHAPE * np.arctan(_REACH)) / (SHAPE * _REACH)
_SLOPE: Floats = np.gradient(_SHARE, _REACH)


#: The state: estimates (n, states), what is known of friction (n, 2), and the policy's.
Limited = tuple[NDArray[Any], NDArray[Any], Any]


def _lacking_peak(scenario: LimitedScenario) -> str:
    if scenario.dynamics == "kinematic":
        return "tyres that saturate: a car with dynamics='kinematic' has none"
    return "" if scenario.tyre != "linear" else "tyres that saturate: make the scenario with tyre='magic_formula'"


class AxleObserver(LinearQuadratic):
    """Sideslip and slip offsets of the axles, which follow within some steps; its commands are not used."""

    name = "slip-limited"
    needs = (Need("tyres that saturate", _lacking_peak),)
    estimated = Estimated(offsets=True, curvature=True)
    # By hand: round ones, but offsets and bends that may change faster, as slips do at the limit.
    weights = Weights(rate=1.0, slip=1e-3, steer=1e-3, drift=0.04, bend=0.8)

    def __init__(self, scenario: LimitedScenario) -> None:
        super().__init__(scenario, self.weights)


class SlipLimited:
    """``policy``, its commands limited; the same to the last bit where they meet no limit.

    The state is the observer's, what is known of friction, and the policy's, which may be anything.

    Raises:
        ValueError: the scenario lacks a channel that slips are estimated from, or its tyres do not saturate.
    """

    def __init__(self, policy: Any, scenario: LimitedScenario) -> None:
        self.__wrapped__, self._observer = policy, AxleObserver(scenario)  # a hash of this is one of ``policy`` too
        self.name = PREFIX + str(getattr(policy, "name", type(policy).__name__))
        self._car, car, base = scenario.vehicle, scenario.vehicle, scenario.vehicle.wheelbase
        self._stiffness = np.array([[car.front_cornering_stiffness], [car.rear_cornering_stiffness]])
        self._load = car.mass * GRAVITY / base * np.array([[car.cg_to_rear_axle], [car.cg_to_front_axle]])
        self._nominal, self._kept = 1.0 / scenario.friction, math.exp(-scenario.control_step / FADE)
        order = {channel.name: i for i, channel in enumerate(scenario.channels)}
        self._speed, self._before = order["speed"], order["steering_command"]
        self._rate = scenario.action == "steering_rate"
        self._scale = scenario.max_steering_rate * scenario.control_step if self._rate else scenario.max_steering_angle

    def predict(
        self,
        observation: ArrayLike,
        state: Limited | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Limited]:
        """Return actions and the next state, as every policy."""
        known, friction, others = state or (None, None, None)
        _, estimates = self._observer.predict(observation, known, episode_start)
        action, others = self.__wrapped__.predict(observation, others, episode_start, deterministic)
        assert estimates is not None
        rows, given = np.atleast_2d(np.asarray(observation, dtype=np.float64)), np.asarray(action).reshape(-1)
        kept = np.zeros((2, len(rows))) if friction is None else np.atleast_2d(friction).T
        if episode_start is not None:
            kept = np.where(np.asarray(episode_start, dtype=bool).reshape(-1), 0.0, kept)
        speed = np.maximum(rows[:, self._speed], SLOWEST)
        kept, low, high = self._limits(np.atleast_2d(estimates).T, speed, kept)
        before = rows[:, self._before] if self._rate else 0.0
        asked = before + self._scale * given.clip(-1.0, 1.0).astype(np.float64)
        limited = np.minimum(np.maximum(asked, low), high)
        told = np.where(limited == asked, given, (limited - before) / self._scale).astype(np.float32)[:, None]
        if np.ndim(observation) == 1:
            return told[0], (estimates, kept.T[0], others)
        return told, (estimates, kept.T, others)

    def _limits(self, estimates: Floats, speed: Floats, known: Floats) -> tuple[Floats, Floats, Floats]:
        """Return what is known of friction now, (2, n), and the least and the largest command, rad, (n,).

        Args:
            estimates: the observer's, (states, n).
            speed: m/s, (n,).
            known: sums of the weights of 1 / mu and of weight times 1 / mu, (2, n).
        """
        car, turn = self._car, estimates[YAW_RATE]
        course = estimates[SIDESLIP] + car.cg_to_front_axle * turn / speed  # of the front wheels, rad
        slips = np.stack([estimates[STEER] - course, car.cg_to_rear_axle * turn / speed - estimates[SIDESLIP]])
        given = slips + estimates[STATES : STATES + 2]  # force over stiffness
        known = self._kept * known + self._told(slips, given)
        mu = (1.0 / SPREAD**2 + known[0]) / (self._nominal / SPREAD**2 + known[1])
        front, rear = mu * self._load
        peak = LINEAR_AT_PEAK * rear / self._stiffness[1]
        force = self._stiffness[1] * given[1]
        limits = []
        for side in (-1.0, 1.0):
            fastest = mu * GRAVITY / speed + (peak - side * slips[1]) / SLIP_TIME
            moment = car.yaw_inertia * (fastest - side * turn) / TURN_TIME
            most = (moment + car.cg_to_rear_axle * side * force) / car.cg_to_front_axle
            limits.append(course + side * slip_at(most.clip(-front, front), self._stiffness[0], front))
        return known, limits[0], limits[1]

    def _told(self, slips: Floats, given: Floats) -> Floats:
        """Return weight and weight times 1 / mu that both axles tell in a step, (2, n).

        Args:
            slips, given: of the axles, rad, (2, n); ``given`` is the force over the stiffness.
        """
        size = np.maximum(np.abs(slips), 1e-6)
        share = given * np.sign(slips) / size
        reach, slope = np.interp(share, _SHARE, _REACH), np.interp(share, _SHARE, _SLOPE)
        whole = self._stiffness / (SHAPE * self._load)  # B alpha is this times alpha / mu
        weight = (size * size * slope * whole / DOUBT) ** 2
        return np.stack([weight.sum(axis=0), (weight * reach / (size * whole)).sum(axis=0)])
