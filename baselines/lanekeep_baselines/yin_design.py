"""Yin 2010: the design model, the LQR and the disturbance observer, with the weights behind the printed gains.

Source: X. Yin, "Fahrzeug-Querregelung", slides, Dortmund 25.06.2010. Its last page prints k_c and k_o without speed or
car; both were decoded by inverting the Riccati equations: v = 25 m/s, b_w = -a_w = 11.16 1/s, a22/v = -5.137 1/s,
b2 = 1.861 1/s², hence the angle is the steering wheel's. The speed is forced, b_w is not, and a11, a12, a21 and b1 do
not enter the gains at all: `lanekeep replicate yin` shows what they leave open.

Misprints of the slides: y_d' = v theta_d + v beta has the wrong sign of beta for y_d = path minus vehicle; the 4×4
matrices of the car with sideslip print a11 where the equations have a11/v, both times that they are shown. The
matrices of the reduced model and of the observer are right.

Signs and units in this file and in `yin_observer` are Yin's own: errors are PATH MINUS VEHICLE (y_d = -lateral_error,
theta_d = -heading_error), angles are of the STEERING WHEEL; yaw rate and curvature are + left, as everywhere.
`yin` converts, once, where channels come in and commands go out.

Steering wheel: the weights put a price on the angle of Yin's steering wheel, geared 16:1. Every car is designed as if
its wheel were geared so (`STEERING_RATIO`): the same weights then mean the same activity of the road wheel, and the
gear of the column, which no signal passes through, changes nothing.

Actuator: a first-order lag, b_w = -a_w = 1/lag. A car without a lag, or with one below 20 ms, is designed with 20 ms
(`FASTEST_LAG`), so that all cars share one structure; the loop is far slower than that. Rate and angle limits are not
in the design; the redesign takes a delay for more lag (`without_delay`).

Kinematic scenarios: a car that does not slip is the limit of stiff tyres, and is designed with tyres 1000 times as
stiff. (Gains for the real tyres expect understeer: without it they are too high, and unstable from 20 to 50 m/s on.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_env.physics.parameters import VehicleParameters

#: Steering wheel over road wheel of Yin's car; the angle that the weights price.
STEERING_RATIO = 16.0
#: Shortest actuator lag of the design, s.
FASTEST_LAG = 0.02
#: How much stiffer than the car's the tyres of a car without slip are.
NO_SLIP = 1000.0
#: Lag that a delay counts for, by its length.
DELAY_AS_LAG = 1.5
#: Speeds of the design points, m/s; gains are interpolated between them and clamped outside.
SCHEDULE: Floats = np.arange(15.0, 50.1, 5.0)
#: a22/v is taken at this speed below it, m/s: at standstill a single-track car has no yaw dynamics.
SLOWEST_YAW_SPEED = 1.0

#: Weights of states and inputs for a design speed in m/s: Q(v_i) and R, or Q_o(v_i) and R_o. The slides let Q and Q_o
#: differ from speed to speed, and print neither.
Weights = Callable[[float], tuple[Floats, Floats]]


def control_weights(speed: float) -> tuple[Floats, Floats]:
    """Return Q of (steering wheel, yaw rate, heading error, lateral error) and R behind the printed k_c.

    The last digits are chosen, within what the printed gains leave open, so that every printed digit comes back. They
    tell of 25 m/s alone and are taken at every speed; a Q(v_i) of another shape is as good a reading of the slides.
    """
    return np.diag([0.0, 0.0, 34.04, 0.27784]), np.eye(1)


def printed_weights(speed: float) -> tuple[Floats, Floats]:
    """Return the weights behind the printed k_o, the same at every speed.

    Fifteen gains of four decimals leave Q_o wide open: diag(0.0143, 0.00203, 0.00355, 0.00558, 0.00357) misses two of
    them by one in the last digit; these values give all fifteen.
    """
    return np.diag([0.009, 0.0025, 0.003546, 0.0036, 0.003571]), np.eye(3)


def redesigned_weights(speed: float) -> tuple[Floats, Floats]:
    """Return the redesign's weights: a quick delta_s, and a yaw rate, which in a curve contains v kappa, not trusted.

    Up to 20 m/s they are constant. Held constant above, the loop on a car with sideslip swings more and more (Yin's
    car: damping 0.03 at 50 m/s; CommonRoad's stiffer ones: unstable from 40 m/s), because the model without sideslip
    explains the yaw motion ever less. Trusting the yaw rate again and estimating delta_s faster cures it; v kappa is
    small at speed anyway. Damping is then 0.1 or more for all four cars up to 50 m/s at a control step of 50 ms.
    """
    ratio = max(1.0, speed / 20.0)
    disturbance = 3570.0 * ratio**2.5
    yaw_rate = max(150.0, 1e4 / ratio**6)
    return np.diag([1.43, 0.203, 3.55e-4, 5.58e-4, disturbance]), np.diag([yaw_rate, 1.0, 1.0])


#: What the observer measures: r, theta_d, y_d out of (delta_L, r, theta_d, y_d, delta_s).
OUTPUTS: Floats = np.eye(5)[1:4]


@dataclass(frozen=True)
class YinModel:
    """Coefficients of Yin's single-track model (linear tyres) and of its steering actuator.

    beta' = a11/v beta + (a12/v² - 1) r + b1/v delta,  r' = a21 beta + a22/v r + b2 delta,
    delta' = actuator_rate (delta_c - delta)

    Units: a11 m/s², a12 m²/s², a21 1/s², a22 m/s², b1 m/s² and b2 1/s² per rad of steering wheel, actuator_rate 1/s.
    """

    a11: float
    a12: float
    a21: float
    a22: float
    b1: float
    b2: float
    actuator_rate: float

    @classmethod
    def of(cls, car: VehicleParameters, steering_ratio: float | None = None, slip: bool = True) -> YinModel:
        """Derive the coefficients from a car.

        Args:
            car: the nominal vehicle.
            steering_ratio: steering wheel over road wheel, instead of the car's own.
            slip: false for a kinematic car.
        """
        ratio = car.steering_ratio if steering_ratio is None else steering_ratio
        stiffness = 1.0 if slip else NO_SLIP
        front, rear = stiffness * car.front_cornering_stiffness, stiffness * car.rear_cornering_stiffness
        to_front, to_rear = car.cg_to_front_axle, car.cg_to_rear_axle
        moment = rear * to_rear - front * to_front
        return cls(
            a11=-(front + rear) / car.mass,
            a12=moment / car.mass,
            a21=moment / car.yaw_inertia,
            a22=-(front * to_front**2 + rear * to_rear**2) / car.yaw_inertia,
            b1=front / (car.mass * ratio),
            b2=front * to_front / (car.yaw_inertia * ratio),
            actuator_rate=1.0 / max(car.steering.lag, FASTEST_LAG),
        )

    def plant(self, speed: float) -> tuple[Floats, Floats]:
        """Return A(v), B of the reduced model, without sideslip: states (delta_L, r, theta_d, y_d), input delta_c."""
        a = np.zeros((4, 4))
        a[0, 0] = -self.actuator_rate
        a[1, 0] = self.b2
        a[1, 1] = self.a22 / max(speed, SLOWEST_YAW_SPEED)
        a[2, 1] = -1.0
        a[3, 2] = speed
        return a, np.array([[self.actuator_rate], [0.0], [0.0], [0.0]])

    def disturbed_plant(self, speed: float) -> tuple[Floats, Floats]:
        """Return A_o(v), B_o: the reduced model with a constant disturbance delta_s of the command as fifth state."""
        a, b = self.plant(speed)
        return np.block([[a, b], [np.zeros((1, 5))]]), np.vstack([b, [[0.0]]])

    def steady_curve(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return (c0, c2) of sideslip and of steering wheel in a steady curve: each is (c0 + c2 v²) kappa, rad.

        From beta' = r' = 0 with r = v kappa: a11 beta + b1 delta = (v² - a12) kappa, a21 beta + b2 delta = -a22 kappa.
        """
        det = self.a11 * self.b2 - self.a21 * self.b1
        sideslip = (self.a22 * self.b1 - self.a12 * self.b2) / det, self.b2 / det
        steering = (self.a12 * self.a21 - self.a11 * self.a22) / det, -self.a21 / det
        return sideslip, steering


def without_delay(car: VehicleParameters) -> VehicleParameters:
    """Return a car whose steering lags instead of being late.

    The design has no place for a delay. As if there were none, `yin-lqr-observer` is unstable on CommonRoad's
    cars with 50 ms from 30 m/s on; with the delay and half of it again as lag it is stable on all full-size cars that
    are stable without a delay, up to 50 m/s. Less and more lag are both worse (`lanekeep margins`).
    """
    steering = car.steering
    lag = steering.lag + DELAY_AS_LAG * steering.delay
    return replace(car, steering=replace(steering, lag=lag, delay=0.0))


@lru_cache(maxsize=256)
def control_gains(model: YinModel, speed: float, weights: Weights = control_weights) -> Floats:
    """Return k_c of u = -k_c (delta_L, r, theta_d, y_d) at one design speed in m/s, shape (4,)."""
    import control  # here, so that what a policy declares can be read without it

    gains, _, _ = control.lqr(*model.plant(speed), *weights(speed))
    return _kept(np.asarray(gains, dtype=np.float64)[0])


@lru_cache(maxsize=256)
def observer_gains(model: YinModel, speed: float, weights: Weights) -> Floats:
    """Return k_o of the observer's correction k_o (y - C_o x) at one design speed in m/s, shape (5, 3)."""
    import control

    a, _ = model.disturbed_plant(speed)
    gains, _, _ = control.lqr(a.T, OUTPUTS.T, *weights(speed))
    return _kept(np.asarray(gains, dtype=np.float64).T)


def _kept(gains: Floats) -> Floats:
    """Return gains that many policies are given, which none of them may change."""
    gains.setflags(write=False)
    return gains
