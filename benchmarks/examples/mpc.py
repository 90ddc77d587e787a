"""A linear time-varying MPC by casadi, a car at a time:
lanekeep bench my_suite.toml --policies stanley,benchmarks/examples/mpc.py:make (its scenario needs preview=20)"""

import casadi as ca
import numpy as np

from lanekeep_baselines import OneByOne

STEPS, EVERY = 20, 0.1


def make(scenario):
    """Build the solver once; every car gets a controller of its own."""
    car = scenario.vehicle
    m, jz, lf, lr = car.mass, car.yaw_inertia, car.cg_to_front_axle, car.cg_to_rear_axle
    cf, cr, lag = car.front_cornering_stiffness, car.rear_cornering_stiffness, max(car.steering.lag, 0.02)
    x, u = ca.MX.sym("x", 5, STEPS + 1), ca.MX.sym("u", STEPS)  # lateral, heading, slip, yaw rate, angle; command
    start, v, curve = ca.MX.sym("start", 5), ca.MX.sym("v"), ca.MX.sym("curve", STEPS)
    a = ca.blockcat([[0, v, v, 0, 0], [0, 0, 0, 1, 0],
                     [0, 0, -(cf + cr) / (m * v), (cr * lr - cf * lf) / (m * v**2) - 1, cf / (m * v)],
                     [0, 0, (cr * lr - cf * lf) / jz, -(cf * lf**2 + cr * lr**2) / (jz * v), cf * lf / jz],
                     [0, 0, 0, 0, -1 / lag]])  # fmt: skip
    step = ca.inv(ca.DM.eye(5) - EVERY / 2 * a)  # the trapezoidal rule
    rows, cost = [x[:, 0] - start], 0
    for k in range(STEPS):
        drive = ca.vertcat(0, -v * curve[k], 0, 0, u[k] / lag) * EVERY
        rows.append(x[:, k + 1] - step @ (x[:, k] + EVERY / 2 * a @ x[:, k] + drive))
        cost += (x[0, k + 1] / 0.5) ** 2 + ((x[4, k + 1] - x[4, k]) / EVERY / 0.1) ** 2  # the benchmark's own
    qp = {"x": ca.vertcat(ca.vec(x), u), "f": cost, "g": ca.vertcat(*rows), "p": ca.vertcat(start, v, curve)}
    solve = ca.qpsol("mpc", "osqp", qp, {"print_time": False, "error_on_fail": False, "osqp": {"verbose": False}})
    column = {channel.name: place for place, channel in enumerate(scenario.channels)}
    ahead = [column[f"curvature_preview_{round(k * EVERY / scenario.preview_interval)}"] for k in range(STEPS)]
    first, scale = 5 * (STEPS + 1), scenario.max_steering_angle

    class Car:
        guess, slip = np.zeros(first + STEPS), 0.0

        def act(self, seen):
            speed, yaw = max(seen[column["speed"]], 3.0), seen[column["yaw_rate"]]
            state = seen[column["lateral_error"]], seen[column["heading_error"]], self.slip, yaw
            found = solve(x0=self.guess, lbg=0, ubg=0, p=[*state, seen[column["steering_angle"]], speed, *seen[ahead]])
            self.guess = found["x"]
            self.slip = float(
                found["x"][2] + (found["x"][7] - found["x"][2]) * scenario.control_step / EVERY
            )  # believed
            return float(found["x"][first]) / scale

    return OneByOne(Car)
