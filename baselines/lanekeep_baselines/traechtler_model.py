"""The linear model of a camera-guided van and the gains that follow from it.

Source: Trächtler, Lohmann, Struck, "Regelung der Querbewegung eines kamerageführten Straßenfahrzeugs", 1992. Its kappa
is positive to the right; here it is positive to the left. The deviation e of the look-ahead point is the measured
distance of the edge minus its value on a straight, counted to the left whichever edge is seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lanekeep_baselines.policy import Floats


@dataclass(frozen=True)
class CameraModel:
    """e' = v theta + (l + f)/l v delta, theta' = v (delta/l - kappa), T delta' = command - delta.

    (10) of the source with the heading theta against the road at the look-ahead point in place of x2 = v theta: with
    changing speed only this form is the linearisation of the van, (10) itself needs a constant one.

    Attributes:
        wheelbase: l, m.
        look_ahead: f, of the camera's point ahead of the front axle, m.
        lag: T, of the steering actuator, s.
    """

    wheelbase: float
    look_ahead: float
    lag: float

    @property
    def reach(self) -> float:
        """Distance of the look-ahead point from the rear axle, m."""
        return self.wheelbase + self.look_ahead

    @property
    def proportional_gain(self) -> float:
        """K2 = 2 l/(l + f)², rad/m: keeps the REAR wheel at its distance in steady curves, without an integrator."""
        return 2.0 * self.wheelbase / self.reach**2

    @property
    def derivative_gain(self) -> float:
        """K3 = T K2, rad s/m: cancels the actuator's lag; damping is 1/sqrt(2) at every speed.

        The source tuned a "very small positive" K3 while driving.
        """
        return self.lag * self.proportional_gain

    def rate(self, heading: Floats, steer: Floats, v: Floats) -> Floats:
        """Return e', m/s, of heading and road-wheel angle (rad) and speed (m/s), all (n,)."""
        return v * (heading + self.reach / self.wheelbase * steer)

    def advance(
        self, deviation: Floats, heading: Floats, steer: Floats, command: Floats, curvature: Floats, v: Floats, h: float
    ) -> tuple[Floats, Floats, Floats]:
        """Return (e, theta, delta) after ``h`` seconds of held command, curvature and speed: exact, all (n,).

        m, rad, rad; command in rad, curvature at the look-ahead point in 1/m, v in m/s.
        """
        gone = 1.0 - np.exp(-h / self.lag) if self.lag > 0.0 else 1.0
        rest = steer - command
        # First and second integral of the steering angle over the step.
        angle = command * h + rest * self.lag * gone
        twice = 0.5 * command * h * h + rest * self.lag * (h - self.lag * gone)
        turned = v / self.wheelbase * angle - v * curvature * h
        swept = heading * h + v / self.wheelbase * twice - 0.5 * v * curvature * h * h
        moved = v * (swept + self.reach / self.wheelbase * angle)
        return deviation + moved, heading + turned, steer - rest * gone
