"""The optimum of `lq_design` within limits, as a quadratic program in the commands of the horizon.

    minimise U'HU / 2 + (F t)'U,   |U| <= angle,   |G U + E t| <= limit,

with t = (z, o_f[0], o_r[0] ... o_f[N], o_r[N], kappa[0] ... kappa[N]); slip offsets are held over a step, and the last
ones for ever, as the last curvature is. The horizon ends where the road ahead does; what follows costs what the
optimum without limits makes of it, so that the program's first command is `lq-preview`'s wherever no limit is met.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lanekeep_baselines.lq_design import Cost, Stage
from lanekeep_baselines.lq_model import SIDESLIP, SLOWEST, STEER, YAW_RATE, StepModel
from lanekeep_baselines.policy import Floats
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters
from lanekeep_env.physics.tyres import LINEAR_AT_PEAK


@dataclass(frozen=True)
class Limits:
    """What commands and car may not exceed; infinite where there is no limit.

    Attributes:
        angle: of commands, rad.
        rate: of the road wheel, rad/s.
        friction: coefficient of tyres that saturate: axles stay below the slip at which more slip gives less force.
    """

    angle: float
    rate: float = math.inf
    friction: float = math.inf


@dataclass(frozen=True, eq=False)
class Problem:
    """The program at one speed; N commands, T numbers of t, rows of limits.

    Attributes:
        hessian: H, shape (N, N).
        linear: F, shape (N, T).
        rows: G, shape (rows, N).
        known: E, shape (rows, T).
        limit: shape (rows,).
        angle: rad.
        free: U without limits is free t, shape (N, T).
    """

    hessian: Floats
    linear: Floats
    rows: Floats
    known: Floats
    limit: Floats
    angle: float
    free: Floats

    @classmethod
    @lru_cache(maxsize=256)
    def of(
        cls, car: VehicleParameters, speed: float, step: float, slip: bool, cost: Cost, steps: int, limits: Limits
    ) -> Problem:
        """Condense ``steps`` - 1 control steps of ``step`` s, at whose ``steps`` ends the curvature is known."""
        stage = Stage.of(StepModel.of(car, speed, step, slip), cost, step)
        n, horizon = len(stage.a), steps - 1
        width = n + 3 * steps
        moved, given = np.zeros((n, horizon)), np.eye(n, width)
        hessian, linear = np.zeros((horizon, horizon)), np.zeros((horizon, width))
        axles = _axle_slips(car, max(speed, SLOWEST), n) if slip and math.isfinite(limits.friction) else None
        rows: list[Floats] = []
        known: list[Floats] = []
        most: list[float] = []
        for k in range(horizon):
            here = np.eye(horizon)[k : k + 1]
            told, told_given = stage.output @ moved + stage.direct @ here, stage.output @ given
            hessian += told.T @ told
            linear += told.T @ told_given
            disturbance = stage.known @ _disturbing(n, steps, k, k + 1)
            before = moved[STEER], given[STEER]
            moved, given = stage.a @ moved + stage.b @ here, stage.a @ given + disturbance
            if math.isfinite(limits.rate):
                rows.append(moved[STEER] - before[0])
                known.append(given[STEER] - before[1])
                most.append(limits.rate * step)
            if axles is not None:
                for slip_force, peak in axles:
                    rows.append(slip_force @ moved)
                    known.append(slip_force @ given)
                    most.append(limits.friction * peak)
        # What follows: z'Pz + 2 p'z with the last curvature held.
        held = stage.p @ stage.known @ _disturbing(n, steps, horizon, horizon)
        closed = stage.closed().T
        after = np.linalg.solve(np.eye(n) - closed, closed @ held)
        hessian += moved.T @ stage.p @ moved
        linear += moved.T @ (stage.p @ given + after)
        return cls(
            hessian=hessian,
            linear=linear,
            rows=np.array(rows).reshape(-1, horizon),
            known=np.array(known).reshape(-1, width),
            limit=np.array(most),
            angle=limits.angle,
            free=np.asarray(-np.linalg.solve(hessian, linear), dtype=np.float64),
        )

    def meets(self, t: Floats) -> bool:
        """Whether the optimum meets a limit within the horizon, for ``t`` of shape (T,)."""
        free = self.free @ t
        within = np.abs(free).max() <= self.angle and (np.abs(self.rows @ free + self.known @ t) <= self.limit).all()
        return not within

    def limited(self, t: Floats) -> float:
        """Return the first of the optimal commands, rad; the car's limits are soft, as it may be beyond them."""
        import daqp

        n = len(self.hessian)
        shift, angle = self.known @ t, np.full(n, self.angle)
        upper = np.concatenate([angle, self.limit - shift])
        lower = np.concatenate([-angle, -self.limit - shift])
        sense = np.concatenate([np.zeros(n), np.full(len(self.limit), _SOFT)]).astype(np.int32)
        found, _, flag, _ = daqp.solve(self.hessian, self.linear @ t, self.rows, upper, lower, sense)
        if flag < 1:  # not solved within its iterations; the command is clipped, as any is
            return float((self.free[0] @ t).clip(-self.angle, self.angle))
        return float(found[0])


#: What daqp calls a constraint that may be violated where it must.
_SOFT = 8


def _disturbing(n: int, steps: int, now: int, then: int) -> Floats:
    """What selects (o_f[now], o_r[now], kappa[now], kappa[then]) of t, shape (4, n + 3 steps)."""
    chosen = np.zeros((4, n + 3 * steps))
    for row, column in enumerate((2 * now, 2 * now + 1, 2 * steps + now, 2 * steps + then)):
        chosen[row, n + column] = 1.0
    return chosen


def _axle_slips(car: VehicleParameters, v: float, n: int) -> list[tuple[Floats, float]]:
    """Slip of the front and the rear axle over z, as the force of a linear tyre, N; that at its peak, N.

    The slip is that of the wheels: offsets are of the force that it gives. (To keep the linear force itself within the
    peak gives away half of what the tyre can.)
    """
    load = LINEAR_AT_PEAK * car.mass * GRAVITY / car.wheelbase
    front, rear = np.zeros(n), np.zeros(n)
    front[[STEER, SIDESLIP, YAW_RATE]] = 1.0, -1.0, -car.cg_to_front_axle / v
    rear[[SIDESLIP, YAW_RATE]] = -1.0, car.cg_to_rear_axle / v
    return [
        (car.front_cornering_stiffness * front, load * car.cg_to_rear_axle),
        (car.rear_cornering_stiffness * rear, load * car.cg_to_front_axle),
    ]
