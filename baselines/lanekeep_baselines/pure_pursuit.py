"""Pure pursuit: the rear axle follows the arc through a point of the path ahead.

Sources: Coulter, "Implementation of the pure pursuit path tracking algorithm", CMU-RI-TR-92-01 (the arc, curvature
2 x / L²); Snider, "Automatic steering methods for autonomous automobile path tracking", CMU-RI-TR-09-08, 2009 (the
steering angle delta = atan(2 l sin(alpha) / L_d) and a look-ahead distance in proportion to the speed).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats, LaneScenario, PreviewScenario, SteeringPolicy, turned_on_the_way
from lanekeep_baselines.tunable import Tunable


class PurePursuit(SteeringPolicy):
    """`pure-pursuit`: delta = atan(2 l sin(alpha) / L_d), L_d = max(5 m, 0.8 s times speed) from the rear axle.

    alpha is the angle from the car's axis to the goal, the point of the path L_d ahead of the rear axle. With previews
    that reach so many seconds ahead the path is built from their curvature (beyond the last sample, which at low speed
    is nearer than the goal, its curvature goes on); without, it is the straight line that lateral and heading error
    describe, and the car runs wide in curves by about kappa L_d²/2. The geometry knows no slip: a car that understeers
    runs wider by as much steering as it lacks (Yin's car at 0.4 g and 20 m/s by 1.8 m, at 50 m/s by 9.6 m). Below
    walking pace the command follows the way driven (`turned_on_the_way`).
    """

    name = "pure-pursuit"
    reads = ("lateral_error", "heading_error", "speed", "steering_command")
    uses = ("curvature_preview_*",)
    memory = 1  # the last command, rad
    #: s; shorter follows closer and swings more (Yin's car at 50 m/s: damping 0.18, at 0.5 s 0.14).
    lookahead_time: ClassVar[float] = 0.8
    #: m
    shortest_lookahead: ClassVar[float] = 5.0
    tunable = (Tunable("lookahead_time", 0.2, 3.0), Tunable("shortest_lookahead", 1.0, 20.0))

    def __init__(self, scenario: PreviewScenario) -> None:
        super().__init__(scenario)
        self._wheelbase, self._to_rear = scenario.vehicle.wheelbase, scenario.vehicle.cg_to_rear_axle
        self._step, self._interval = scenario.control_step, scenario.preview_interval
        samples = tuple(channel for channel in self._order if channel.startswith("curvature_preview_"))
        reaches = (len(samples) - 1) * self._interval >= self.lookahead_time - 1e-9
        self._samples = samples if reaches else ()

    def lookahead(self, speed: Floats) -> Floats:
        """Return L_d, m, (n,)."""
        return np.maximum(self.shortest_lookahead, self.lookahead_time * speed)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        before = np.where(fresh, at["steering_command"], memory[:, 0])
        steer = turned_on_the_way(self.wanted(at), before, at["speed"], self._step)
        return steer, steer[:, None]

    def wanted(self, at: Mapping[str, Floats]) -> Floats:
        """Return the road-wheel angle of the law, rad, (n,)."""
        # Path frame: origin beside the centre of gravity, x along the path, y to the left.
        sine, cosine = np.sin(at["heading_error"]), np.cos(at["heading_error"])
        rear_x = -self._to_rear * cosine
        rear_y = at["lateral_error"] - self._to_rear * sine
        distance = self.lookahead(at["speed"])
        # Further off than L_d, the nearest point of the path is the goal.
        ahead = rear_x + np.sqrt(np.maximum(distance * distance - rear_y * rear_y, 0.0))
        goal_x, goal_y = self._point(at, ahead) if self._samples else (ahead, np.zeros_like(ahead))
        x, y = goal_x - rear_x, goal_y - rear_y
        # sin(alpha) = (lateral distance of the goal in the car's axes) / L, with the goal's actual distance L.
        curvature = 2.0 * (y * cosine - x * sine) / (x * x + y * y)
        return self.steering(curvature, at["speed"])

    def steering(self, curvature: Floats, speed: Floats) -> Floats:
        """Return the road-wheel angle for an arc of ``curvature`` (1/m), rad, (n,)."""
        return np.arctan(self._wheelbase * curvature)

    def _point(self, at: Mapping[str, Floats], ahead: Floats) -> tuple[Floats, Floats]:
        """Return the path's point at arc length ``ahead`` (n,) from the previews, m, (n,) each.

        Each step goes along its mean heading. Points behind the car (far off it) lie on the last curvature.
        """
        curvature = [at[channel] for channel in self._samples]
        spacing = at["speed"] * self._interval
        left, heading, x, y = ahead, np.zeros_like(ahead), np.zeros_like(ahead), np.zeros_like(ahead)
        for k, start in enumerate(curvature):
            last = k == len(curvature) - 1
            end = start if last else curvature[k + 1]
            step = left if last else np.clip(left, 0.0, spacing)
            # Curvature is linear between samples: at the end of a shorter step it is part of the way.
            part = step / np.maximum(spacing, 1e-9) * (end - start)
            mean = heading + step * (0.5 * start + part / 6.0)
            x, y = x + step * np.cos(mean), y + step * np.sin(mean)
            heading = heading + step * (start + 0.5 * part)
            left = left - step
        return x, y


class PurePursuitUndersteer(PurePursuit):
    """`pure-pursuit-understeer`: the same arc with the angle that the nominal car needs for it, an extension.

    Coulter asks the car for a curvature; delta = atan(l kappa) + (m_f/C_f - m_r/C_r) v² kappa, with the axle masses
    m_f and m_r, is what a car with slip drives it with in the steady state. The loop is quicker for it and needs a
    longer look-ahead at speed. The rear axle's slip is left out: the car runs wide by about that angle times L_d.
    """

    name = "pure-pursuit-understeer"
    lookahead_time = 1.0

    def __init__(self, scenario: LaneScenario) -> None:
        super().__init__(scenario)
        car = scenario.vehicle
        slips = scenario.dynamics != "kinematic"
        front = car.mass * car.cg_to_rear_axle / car.wheelbase / car.front_cornering_stiffness
        rear = car.mass * car.cg_to_front_axle / car.wheelbase / car.rear_cornering_stiffness
        self._understeer = front - rear if slips else 0.0

    def steering(self, curvature: Floats, speed: Floats) -> Floats:
        return super().steering(curvature, speed) + self._understeer * speed * speed * curvature
