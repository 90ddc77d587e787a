"""An LQR by python-control: lanekeep bench --policies stanley,benchmarks/examples/lqr.py:Lqr --episodes 16"""

import control
import numpy as np

from lanekeep_baselines import SteeringPolicy


class Lqr(SteeringPolicy):
    """Discrete LQR of the single track at 20 m/s, and the steady angle of the curve ahead."""

    name = "lqr"
    reads = ("lateral_error", "heading_error", "yaw_rate", "speed", "curvature_preview_0")

    def __init__(self, scenario):
        super().__init__(scenario)
        car, v = scenario.vehicle, 20.0
        m, jz, lf, lr = car.mass, car.yaw_inertia, car.cg_to_front_axle, car.cg_to_rear_axle
        cf, cr = car.front_cornering_stiffness, car.rear_cornering_stiffness
        # State: lateral error, heading error, sideslip, yaw rate; input: road-wheel angle.
        a = np.zeros((4, 4))
        a[0] = 0, v, v, 0
        a[1] = 0, 0, 0, 1
        a[2] = 0, 0, -(cf + cr) / (m * v), (cr * lr - cf * lf) / (m * v * v) - 1
        a[3] = 0, 0, (cr * lr - cf * lf) / jz, -(cf * lf**2 + cr * lr**2) / (jz * v)
        b = np.array([[0], [0], [cf / (m * v)], [cf * lf / jz]])
        plant = control.sample_system(control.ss(a, b, np.eye(4), 0), scenario.control_step)
        self._gain = np.asarray(control.dlqr(plant, np.diag([4.0, 0, 0, 0]), [[100.0]])[0])[0]
        self._length, self._understeer = car.wheelbase, m * (lr / cf - lf / cr) / car.wheelbase
        self._slip = lr, m * lf / (cr * car.wheelbase)

    def command(self, at, memory, fresh):
        curve, v = at["curvature_preview_0"], at["speed"]
        angle = (self._length + self._understeer * v * v) * curve  # the steady angle, slip and yaw rate of the curve
        slip = (self._slip[0] - self._slip[1] * v * v) * curve
        off = (at["lateral_error"], at["heading_error"] + slip, 0.0 * curve, at["yaw_rate"] - v * curve)
        return angle - sum(k * x for k, x in zip(self._gain, off, strict=True)), None
