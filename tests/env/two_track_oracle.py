"""A two-track car, written for the tests with numpy and scipy alone."""

import math

import numpy as np
from scipy.integrate import solve_ivp

GRAVITY, SHAPE = 9.81, 1.5


def tyre(slip, stiffness, peak):
    """Magic formula without curvature, N."""
    return peak * math.sin(SHAPE * math.atan(stiffness * slip / (SHAPE * peak)))


class TwoTrack:
    """Four wheels at a constant speed, each with its own slip angle and load; roll has settled.

    A wheel of n times its load at rest has the friction mu (1 - k (n - 1)) and the stiffness C n (1 - c (n - 1)).
    """

    def __init__(self, car, friction):
        self.car, self.friction = car, friction
        half = 0.5 * car.mass * GRAVITY / car.wheelbase
        self.loads = half * car.cg_to_rear_axle, half * car.cg_to_front_axle

    def wheel(self, axle, slip, load):
        car, n = self.car, load / self.loads[axle]
        stiffness = 0.5 * (car.front_cornering_stiffness, car.rear_cornering_stiffness)[axle]
        stiffness *= n * (1.0 - car.stiffness_load_sensitivity * (n - 1.0))
        return tyre(slip, stiffness, self.friction * (1.0 - car.friction_load_sensitivity * (n - 1.0)) * load)

    def forces(self, v, beta, r, steer):
        """Lateral forces ((front left, front right), (rear left, rear right)), N, and lateral acceleration, m/s²."""
        car, x, y = self.car, v * math.cos(beta), v * math.sin(beta)
        half, share = 0.5 * car.track, car.front_roll_stiffness
        slips = [
            [angle - math.atan2(y + arm * r, x - side * half * r) for side in (1, -1)]
            for arm, angle in ((car.cg_to_front_axle, steer), (-car.cg_to_rear_axle, 0.0))
        ]
        across = v * r
        for _ in range(100):  # the loads follow from the forces that follow from the loads
            pairs = []
            for axle, part in enumerate((share, 1.0 - share)):
                moved = part * car.mass * across * car.height / car.track
                most = 0.999 * self.loads[axle]
                moved = min(max(moved, -most), most)
                left, right = self.loads[axle] - moved, self.loads[axle] + moved
                pairs.append((self.wheel(axle, slips[axle][0], left), self.wheel(axle, slips[axle][1], right)))
            before = across
            across = (sum(pairs[0]) * math.cos(steer - beta) + sum(pairs[1]) * math.cos(beta)) / car.mass
            if abs(across - before) < 1e-7:
                break
        return pairs, across

    def drive(self, v, steer, times):
        """Sideslip, yaw rate and lateral acceleration at ``times`` from straight driving; ``steer`` is of the time."""
        car = self.car

        def rates(t, state):
            pairs, across = self.forces(v, *state, steer(t))
            turn = car.cg_to_front_axle * sum(pairs[0]) * math.cos(steer(t)) - car.cg_to_rear_axle * sum(pairs[1])
            turn += 0.5 * car.track * math.sin(steer(t)) * (pairs[0][0] - pairs[0][1])
            return across / v - state[1], turn / car.yaw_inertia

        found = solve_ivp(rates, (0.0, times[-1]), (0.0, 0.0), t_eval=times, rtol=1e-6, atol=1e-8)
        across = [self.forces(v, *state, steer(t))[1] for t, state in zip(times, found.y.T, strict=True)]
        return np.array([*found.y, across])
