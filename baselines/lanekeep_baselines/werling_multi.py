"""Werling, Gröll, Bretthauer 2008: the multi-controller as one policy, `werling-drive`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.werling import GripScenario, WerlingLateral, WerlingLateralAhead
from lanekeep_baselines.werling_drive import AccelerationIntegrator, EngineMap, split_range
from lanekeep_baselines.werling_lateral import SMALLEST
from lanekeep_baselines.werling_longitudinal import Grip, Lead, LongitudinalControl, LongitudinalTuning, SetPosition
from lanekeep_baselines.werling_tyres import WerlingCar
from lanekeep_env.physics.load_transfer import LARGEST_ALONG
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.powertrain_parameters import Powertrain


class DriveScenario(GripScenario, Protocol):
    """What the longitudinal control may know besides; `lanekeep_env.DriveScenario` is one."""

    @property
    def powertrain(self) -> Powertrain: ...
    @property
    def friction_circle(self) -> bool: ...


#: Of the previews, those that count for what a bend leaves to engine and brake, and what it leaves at the least.
NEAR_PREVIEWS, LEFT = 3, 0.1
#: Part of the yaw rate that counts where the car turns faster than the bend asks for: who comes back to the path, or is
#: about to spin, needs the tyres across.
TURNING = 0.8
#: No car ahead changes its speed faster, m/s²: more is another car.
ANOTHER = 25.0


class Pedals(NamedTuple):
    """Pedal, throttle positive, brake negative; accelerations, m/s²: of engine and brake, expected, of resistances."""

    pedal: Floats
    given: Floats
    expected: Floats
    resistance: Floats


class WerlingDrive(WerlingLateralAhead):
    """`werling-drive`: the whole multi-controller, steering and pedal.

    The least acceleration that speed, gap and stop law ask for goes through the inverse of the engine's map to throttle
    or brake, with an integrator for wind and slope. A car that stands, and is not to start, is held by the brake.
    Backwards, where the set speed is negative, all laws hold in that direction.

    Friction, which the scenario tells, limits both: engine and brake ask for no more than a bend leaves of it, the
    steering for no more than they do; where it is little, gaps are longer and braking begins earlier. With a set
    position in the way, that is driven to.

    The integrator compares what is measured with what the model expects behind the pedals' lag; while a gear change
    interrupts the torque, and until the pedals have followed, it stands still: nothing winds up.
    """

    name = "werling-drive"
    reads = (
        *WerlingLateral.reads,
        "acceleration",
        "gear",
        "set_speed",
        "lead_gap",
        "lead_speed",
        "stop_gap",
    )
    uses = (*WerlingLateralAhead.uses, "position_*")
    actions = 2
    #: c_v is that with which the speed law takes over at Figure 10's 12.5 s, gear changes included.
    longitudinal: ClassVar[LongitudinalTuning] = LongitudinalTuning(speed_rate=0.49)
    #: Of the acceleration's integrator, 1/s.
    integration: ClassVar[float] = 0.8
    #: Below this speed (m/s) and this wanted acceleration (m/s²) the car stands; brake that holds it, share.
    stands: ClassVar[tuple[float, float]] = (0.02, 0.1)
    holding: ClassVar[float] = 0.2
    #: Where the pedals give that share of what is wanted and the car still stands, a slope holds it.
    uphill: ClassVar[float] = 0.9
    #: Lags of the pedals after a gear change until acceleration is what it is expected to be again.
    settled: ClassVar[float] = 3.0

    def __init__(self, scenario: DriveScenario) -> None:
        super().__init__(scenario)
        self._laws = LongitudinalControl(self.longitudinal)
        self._integrator = AccelerationIntegrator(self.integration, scenario.control_step)
        # Behind the laws' and the integrator's: what the pedals are due to give behind their lag, m/s², the last gear,
        # the time for which the integrator stands still, s, and the speed of the car ahead, m/s.
        self.memory = self._laws.memory + self._integrator.memory + 4
        self._grip, self._circle = scenario.friction * GRAVITY, scenario.friction_circle
        self._tracks = "position_gap" in self._order
        self._train, self._mass, self._step = scenario.powertrain, scenario.vehicle.mass, scenario.control_step
        self._far = next(c.high for c in scenario.channels if c.name == "lead_gap")
        train = self._train
        speeds = np.linspace(train.idle_speed, train.idle_speed + 600.0, 60)
        # Never quite nothing: an engine without drag has no inverse where the throttle does nothing.
        full = train.peak_torque * np.maximum(1.0 - ((speeds - train.peak_speed) / train.torque_width) ** 2, 1e-6)
        drag = train.drag_torque + train.drag_slope * speeds
        self._engine = EngineMap(
            speeds, np.array([0.0, 1.0]), np.stack([-drag, full], axis=1) * train.efficiency / self._mass
        )
        # Of the way to what they are asked for, what the pedals go in a step.
        self._share = float(-np.expm1(-self._step / train.pedal_lag)) if train.pedal_lag > 0.0 else 1.0
        self._ratios = np.array([*train.gears, train.reverse]) * train.final_drive / train.wheel_radius

    def _direction(self, at: Mapping[str, Floats]) -> Floats:
        return np.where(at["gear"] < -0.5, -1.0, 1.0)

    def _left_along(self, at: Mapping[str, Floats]) -> Floats:
        """Return what bends leave of the tyres' friction to engine and brake, m/s², (n,)."""
        most = LARGEST_ALONG * self._grip
        if not self._circle:
            return np.full_like(at["speed"], self._grip)
        bend = np.max([np.abs(at[name]) for name in self._samples[:NEAR_PREVIEWS]], axis=0)
        across = at["speed"] * np.maximum(at["speed"] * bend, TURNING * np.abs(at["yaw_rate"]))
        return np.sqrt(np.clip(self._grip**2 - across**2, (LEFT * most) ** 2, most**2))

    def _left_across(self, along: Floats) -> WerlingCar:
        """Return the car with the peaks that ``along``, what engine and brake take, m/s², leaves, (n,)."""
        if not self._circle:
            return self._car
        used = np.minimum(np.abs(along) / self._grip, LARGEST_ALONG)
        share = np.sqrt(1.0 - used * used)
        return self._car._replace(front_peak=share * self._car.front_peak, rear_peak=share * self._car.rear_peak)

    def _pedals(self, v: Floats, asked: Floats, gear: NDArray[np.intp], most: Floats, before: Floats) -> Pedals:
        """Return what gives the acceleration ``asked``, m/s², at ``v`` m/s in a gear, -1 for reverse, (n,).

        Tyres give ``most``, m/s²; engine and brake give ``before`` by now.
        """
        train, ratio = self._train, self._ratios[gear]
        resistance = 0.6 * train.drag_area * v * v / self._mass + GRAVITY * train.rolling
        resistance = resistance - train.creep * np.clip(1.0 - v / train.creep_speed, 0.0, 1.0)
        # On a straight anti-lock and traction control see to what tyres give; in a bend the brake is pressed no farther
        # than gives that within a step, whatever its lag.
        least = before - (most + before) / self._share
        asked = np.where(
            most < LARGEST_ALONG * self._grip, np.clip(asked + resistance, least, most) - resistance, asked
        )
        engine_speed = np.maximum(v * ratio, train.idle_speed)
        found = split_range(self._engine, asked, engine_speed, ratio, resistance, train.brake, 1.0)
        # On the slipping converter a closed throttle does not drag: the brake does all.
        slips = (v * ratio < train.idle_speed) & (asked + resistance <= 0.0)
        brake = np.where(slips, np.clip(-(asked + resistance) / train.brake, 0.0, 1.0), found.pressure)
        given = np.where(slips, -train.brake * brake, found.expected + resistance)
        expected = np.clip(given, -most, most) - resistance
        return Pedals(np.where(brake > 0.0, -brake, found.throttle), given, expected, resistance)

    def _position(self, at: Mapping[str, Floats]) -> SetPosition | None:
        """Return the set position, None in a scenario without."""
        if not self._tracks:
            return None
        gap = at["position_gap"]
        gap = np.where((gap >= self._far) | (at["gear"] < -0.5), np.inf, gap)
        course, kappa = at["heading_error"] + at["sideslip"], at[self._samples[0]]
        pace = np.maximum(np.cos(course), SMALLEST) / np.maximum(1.0 - at["lateral_error"] * kappa, SMALLEST)
        return SetPosition(gap, at["position_speed"], at["position_acceleration"], pace)

    def pedal(self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool) -> tuple[Floats, Floats]:
        """Return the pedal, throttle positive, brake negative, (n,), and the next memory."""
        way, split = self._direction(at), self._laws.memory
        v, measured = way * at["speed"], way * at["acceleration"]
        gap = np.where(at["lead_gap"] >= self._far, np.inf, at["lead_gap"])
        stop = np.where(at["stop_gap"] >= self._far, np.inf, at["stop_gap"])
        set_speed = np.maximum(way * at["set_speed"], 0.0)
        # Slope and wind are kept as they are forwards: backwards they push the other way.
        state, (before, last, held, ahead) = way[:, None] * memory[:, split : split + 1], memory[:, split + 1 :].T
        most, pushed = self._left_along(at), np.where(fresh, 0.0, state[:, 0])
        grip = Grip(np.maximum(np.minimum(most, self._train.brake) + pushed, LEFT * self._grip), self._grip)
        change = (at["lead_speed"] - ahead) / self._step
        pull = np.where(fresh | (np.abs(change) > ANOTHER), 0.0, change)
        lead = Lead(gap, at["lead_speed"] - v, pull)
        wanted, laws = self._laws.step(v, set_speed, lead, stop, memory[:, :split], fresh, grip, self._position(at))
        asked = self._integrator.asked(wanted, state, fresh)
        gear = np.clip(np.rint(at["gear"]), -1, len(self._train.gears) - 1).astype(np.intp)
        # What the pedals of the steps before give by now; the rest of what is measured is slope and wind.
        before = np.where(fresh, measured, before)
        found = self._pedals(v, asked, gear, most, before)
        settling = self._train.shift_time + self.settled * self._train.pedal_lag
        held = np.where(fresh, 0.0, np.where(gear == last, np.maximum(held - self._step, 0.0), settling))
        standing = (v < self.stands[0]) & (wanted < self.stands[1])
        pedal = np.where(standing, np.minimum(found.pedal, -self.holding), found.pedal)
        before = np.where(fresh, measured + found.resistance, before)
        due = np.clip(before, -most, most) - found.resistance - pushed
        uphill = (wanted >= self.stands[1]) & (due > self.uphill * wanted)
        still = ((v < self.stands[0]) & ~uphill) | (held > 0.0)
        state = self._integrator.advance(due, measured, asked, found.expected, still, state, fresh)
        given = np.where(standing, -self._train.brake * self.holding, found.given)
        before = before + self._share * (given - before)
        rest = np.stack([before, gear, held, at["lead_speed"]], axis=1)
        return pedal, np.concatenate([laws, way[:, None] * state, rest], axis=1)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        pedal, following = self.pedal(at, memory, fresh)
        taken = following[:, self._laws.memory + self._integrator.memory]
        return np.stack([self.steering(at, self._left_across(taken)), pedal], axis=1), following

    def _action(self, command: Floats, at: Mapping[str, Floats]) -> Floats:
        return np.concatenate([super()._action(command[:, 0], at), command[:, 1:]], axis=1)
