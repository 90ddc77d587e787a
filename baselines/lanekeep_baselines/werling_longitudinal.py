"""Werling, Gröll, Bretthauer 2008: set speed, gap and stopping by override control, as pure steps over rows.

Three laws ask for an acceleration each, the smallest is taken, between a_min and a_max. Without a car in front or
a stop point the distance is inf, and the law asks for no restraint. The laws have no integrator: where two of them
cross, the acceleration has no step. (Steps of a set point or a new car in front do step it.)

The limit of comfort, -3.5 m/s², costs safety where a car cuts in or a stop point comes late: there a second, larger
a_min holds, for as long as no less would do. Where the tyres give little (`Grip`), it holds earlier, and the gap is one
from which a car ahead that brakes with all its grip can still be stopped behind.

A set position (x(t), y(t)), which the article has as its outlook without a law, is driven to along the path as (9) does
across it: a = a_p + 2 omega (v_p - v) + omega² (s_p - s), so that s_p - s decays as d does; in place of the speed law
and of comfort's limits.

Corrected against the source: (29) prints "L, tau < 0", both are positive. Read literally, (32) drives through the stop
point: its condition lets go again as the speed falls, and behind s_h - Delta its sign turns. And as (33) meets (32) in
a joint tangent it is never below it: an ungated max selector lets the approach be, and brakes too late. Hence (32) is
latched, is -inf from Delta before the point on, and (33) has its say in the near range only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats

#: A stop point that moves away by more than this between two steps, m, is another one: braking starts anew.
MOVED = 1.0
#: In an emergency: gap that is left, m; way to brake on at least, m; factor of what is needed.
CLEAR, LEAST, SURE = 1.0, 0.02, 1.1
#: A car ahead brakes where it loses more than this, m/s².
BRAKES = 0.5
#: The near range is this much longer than the joint tangent needs, m.
NEAR = 0.5
#: Parts of what full braking gives: more than the first is an emergency; gaps are as long as the second needs.
PART, RESERVE = 0.6, 0.85


class Grip(NamedTuple):
    """What full braking gives, m/s², numbers or (n,) each; without bound where nothing is known of it.

    Attributes:
        own: deceleration by tyres or brake, with slope and resistances.
        lead: of the car ahead.
    """

    own: float | Floats = np.inf
    lead: float | Floats = np.inf


class Lead(NamedTuple):
    """Of the car ahead, (n,) each.

    Attributes:
        gap: to it, m, inf for none.
        change: of the gap, its speed minus ours, m/s; anything where there is none.
        pull: its acceleration, m/s².
    """

    gap: Floats
    change: Floats
    pull: float | Floats = 0.0


class SetPosition(NamedTuple):
    """Of the set position, (n,) each.

    Attributes:
        gap: way to it along the path, m, inf for none.
        speed, acceleration: its own, m/s and m/s².
        pace: our way along the path over what we drive, cos(theta)/(1 - d kappa) of (3).
    """

    gap: Floats
    speed: Floats
    acceleration: Floats
    pace: Floats


#: Of a road of which nothing is known.
UNKNOWN = Grip()


class LongitudinalTuning(NamedTuple):
    """Of the three laws and the override.

    Attributes:
        speed_rate: c_v of the speed law, 1/s.
        standing_gap: L, m.
        time_gap: tau, s.
        gap_rate: lambda of the gap law, 1/s.
        braking: a_h,min, m/s², negative: the deceleration of a stop.
        stop_rate: p of the last metres, 1/s: both poles are at -p (k_p = p², k_d = 2 p).
        least: a_min of comfort, m/s²: the article's limit.
        most: a_max, m/s².
        emergency: a_min where comfort would not do, m/s², more than brake and hills give: see `emergency_law`.
        reaction: of the brake, s: lag and a control step.
        tracking: omega of the set position's error, 1/s.
    """

    speed_rate: float = 0.62
    standing_gap: float = 4.0
    time_gap: float = 1.5
    gap_rate: float = 0.5
    braking: float = -1.7
    stop_rate: float = 2.0
    least: float = -3.5
    most: float = 1.0
    emergency: float = -12.0
    reaction: float = 0.12
    tracking: float = 1.0

    @property
    def ahead(self) -> float:
        """Delta, m: how far before the stop point constant deceleration would end; makes the tangent a joint one."""
        return -self.braking / self.stop_rate**2

    @property
    def near(self) -> float:
        """Where the last metres begin, m before the stop point: the tangent lies 3 Delta before it."""
        return 4.0 * self.ahead + NEAR


def speed_law(tuning: LongitudinalTuning, v: Floats, wanted: Floats) -> Floats:
    """Return a = -c_v (v - wanted), m/s², (n,): (27)."""
    return -tuning.speed_rate * (v - wanted)


def position_law(tuning: LongitudinalTuning, v: Floats, at: SetPosition) -> Floats:
    """Return a = (a_p + 2 omega (v_p - s') + omega² (s_p - s))/pace, m/s², (n,); 0 without a set position.

    The pace is taken as constant: its change is what the lateral law makes small.
    """
    gap, rate = np.where(np.isfinite(at.gap), at.gap, 0.0), tuning.tracking
    wanted = at.acceleration + rate * (2.0 * (at.speed - v * at.pace) + rate * gap)
    return np.where(np.isfinite(at.gap), wanted / at.pace, 0.0)


def gap_law(tuning: LongitudinalTuning, v: Floats, gap: Floats, gap_change: Floats, grip: Grip = UNKNOWN) -> Floats:
    """Return a = (d_f' + lambda (d_f - L - tau v))/tau, m/s², (n,): (30); inf without a car in front.

    In place of L + tau v stands, where it is longer, the way of braking with a part of our grip less that of the car in
    front with all of its own.

    Args:
        tuning: L, tau and lambda.
        v: speed, m/s.
        gap: d_f to the car in front, m, inf for none.
        gap_change: d_f', its speed minus ours, m/s; anything where there is none.
        grip: what full braking gives.
    """
    lead = np.isfinite(gap)
    gap, change = np.where(lead, gap, 0.0), np.where(lead, gap_change, 0.0)
    longer = 0.5 * (v * v / (RESERVE * grip.own) - np.maximum(v + change, 0.0) ** 2 / grip.lead)
    wanted = np.maximum(tuning.standing_gap + tuning.time_gap * v, CLEAR + tuning.reaction * v + longer)
    return np.where(lead, (change + tuning.gap_rate * (gap - wanted)) / tuning.time_gap, np.inf)


def constant_deceleration(tuning: LongitudinalTuning, v: Floats, distance: Floats) -> Floats:
    """Return a = -v²/(2 (distance - Delta)), m/s², (n,): (32); -inf from Delta before the stop point on."""
    left = distance - tuning.ahead
    before = left > 0.0
    return np.where(before, -0.5 * v * v / np.where(before, left, 1.0), -np.inf)


class StopLaw:
    """The stop law (32), (33) with its latch.

    Memory, (n, 2): 1 while braking for a stop point, else 0; the last step's distance of that point, m.
    """

    memory = 2

    def __init__(self, tuning: LongitudinalTuning) -> None:
        self.tuning = tuning

    def step(
        self, v: Floats, distance: Floats, memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats]:
        """Return the acceleration, m/s², (n,), inf where nothing is to stop for yet, and the next memory.

        Args:
            v: speed, m/s.
            distance: s_h - s of the stop point, m, inf for none.
            memory: (n, 2), meaningless in fresh rows; never written to.
            fresh: rows that start, (n,), or one answer for all rows.
        """
        tuning = self.tuning
        point = np.isfinite(distance)
        there = np.where(point, distance, 0.0)
        same = np.logical_not(fresh) & (memory[:, 0] > 0.5) & (there <= memory[:, 1] + MOVED)
        brake = constant_deceleration(tuning, v, there)
        latched = point & (same | (brake <= tuning.braking))
        last = tuning.stop_rate * (tuning.stop_rate * there - 2.0 * v)
        asked = np.where(there <= tuning.near, np.maximum(brake, last), brake)
        following = np.stack([latched.astype(np.float64), np.where(latched, there, 0.0)], axis=1)
        return np.where(latched, asked, np.inf), following


def emergency_law(
    tuning: LongitudinalTuning,
    v: Floats,
    gap: Floats,
    gap_change: Floats,
    distance: Floats,
    grip: Grip = UNKNOWN,
    lead_pull: float | Floats = 0.0,
) -> Floats:
    """Return the deceleration without which the car ahead is met or the stop point passed, m/s², (n,), <= 0.

    Even braking that ends at the car ahead's speed `CLEAR` behind it, where it brakes at its place of rest, or at the
    point; what is driven until the brake acts is no way to brake on. inf where comfort's limit, and a part of the grip,
    does. Arguments as in the laws above; ``lead_pull`` is the acceleration of the car ahead, m/s².
    """
    lead = np.isfinite(gap)
    closing, ahead = np.where(lead, np.maximum(-gap_change, 0.0), 0.0), np.where(lead, gap - CLEAR, np.inf)
    # A car ahead that brakes stands after so much more way.
    brakes = lead & (np.asarray(lead_pull) < -BRAKES)
    its = np.where(brakes, 0.5 * np.maximum(v + gap_change, 0.0) ** 2 / np.where(brakes, -lead_pull, 1.0), np.inf)
    rest = np.minimum(np.where(brakes, ahead + its, np.inf), distance) - v * tuning.reaction
    until = ahead - closing * tuning.reaction
    needed = 0.5 * np.maximum(closing**2 / np.maximum(until, LEAST), v * v / np.maximum(rest, LEAST))
    enough = np.minimum(-tuning.least, PART * grip.own)
    asked = np.where(needed > RESERVE * grip.own, tuning.emergency, np.maximum(-SURE * needed, tuning.emergency))
    return np.where(needed > enough, asked, np.inf)


def override(tuning: LongitudinalTuning, *asked: Floats) -> Floats:
    """Return the smallest acceleration asked for, between a_min and a_max, m/s², (n,): the min selector of Figure 6."""
    smallest = asked[0]
    for other in asked[1:]:
        smallest = np.minimum(smallest, other)
    return np.clip(smallest, tuning.least, tuning.most)


class LongitudinalControl:
    """The three laws and the override in one step: what acceleration to ask for. Memory as `StopLaw`'s."""

    memory = StopLaw.memory

    def __init__(self, tuning: LongitudinalTuning) -> None:
        self.tuning = tuning
        self._stop = StopLaw(tuning)

    def step(
        self,
        v: Floats,
        wanted: Floats,
        lead: Lead,
        distance: Floats,
        memory: Floats,
        fresh: NDArray[np.bool_] | bool,
        grip: Grip = UNKNOWN,
        position: SetPosition | None = None,
    ) -> tuple[Floats, Floats]:
        """Return the acceleration, m/s², (n,), and the next memory, (n, 2).

        Arguments as in the laws above.
        """
        tuning = self.tuning
        stop, following = self._stop.step(v, distance, memory, fresh)
        others = np.minimum(gap_law(tuning, v, lead.gap, lead.change, grip), stop)
        asked = override(tuning, speed_law(tuning, v, wanted), others)
        if position is not None:
            tracks = np.maximum(np.minimum(position_law(tuning, v, position), others), tuning.emergency)
            asked = np.where(np.isfinite(position.gap), tracks, asked)
        needed = emergency_law(tuning, v, lead.gap, lead.change, distance, grip, lead.pull)
        return np.minimum(asked, needed), following
