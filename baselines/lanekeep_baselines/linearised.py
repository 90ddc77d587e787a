"""A policy and its car as one linear loop around straight driving, in discrete time.

The car is that of `lq_model`, exact from one control step to the next; the policy is whatever `predict` makes of small
changes of what it observes and remembers: its numbers are differences, not a formula, so that every smooth policy has
them, a learned one too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.lq_model import HEADING, LATERAL, SIDESLIP, STEER, YAW_RATE, StepModel
from lanekeep_baselines.policy import Floats, SteeringPolicy

#: Channels that are states of the car: their place, and a change of them that is small for any policy (rad, rad/s, m).
_STATE_CHANNELS = {
    "steering_angle": (STEER, 1e-3),
    "sideslip": (SIDESLIP, 1e-3),
    "yaw_rate": (YAW_RATE, 1e-2),
    "heading_error": (HEADING, 1e-3),
    "lateral_error": (LATERAL, 1e-2),
}
#: What a policy sees of its own last command, rad.
_COMMAND, _COMMAND_CHANGE = "steering_command", 1e-3
#: Channels that a straight road leaves alone.
_CONSTANT = ("speed", "curvature")
#: Change of what a policy remembers, in the unit of each number.
_MEMORY_CHANGE = 1e-3
#: Control steps of straight driving after which a policy's memory has settled.
_SETTLED = 500
#: Share by which differences over the whole and over half a change may differ.
_LINEAR = 0.02
#: Measured channels that a camera delivers.
CAMERA = ("lateral_error", "heading_error")


@dataclass(frozen=True, eq=False)
class System:
    """x[k+1] = A x[k] + B u[k], y[k] = C x[k] + D u[k], a control step (s) apart."""

    a: Floats
    b: Floats
    c: Floats
    d: Floats
    step: float

    def response(self, frequencies: Floats) -> NDArray[np.complex128]:
        """Return the frequency response at ``frequencies`` (rad/s), shape (n, outputs, inputs)."""
        z = np.exp(1j * np.atleast_1d(frequencies) * self.step)
        states = np.linalg.solve(z[:, None, None] * np.eye(len(self.a)) - self.a, self.b.astype(complex))
        return np.asarray(self.c @ states + self.d)


def car_of(scenario: Any, speed: float, channels: tuple[str, ...]) -> System:
    """Return the car at ``speed`` (m/s): from what the actuator is told (rad) to ``channels``, delayed as its sensors.

    Raises:
        ValueError: a channel is none of straight driving, or errors are not those of the centre of gravity.
    """
    car, step = scenario.vehicle, scenario.control_step
    if scenario.axles != (car.cg_to_front_axle, car.cg_to_rear_axle):
        raise ValueError(
            "errors of this scenario are not those of the centre of gravity; there is no linear car for it"
        )
    model = StepModel.of(car, speed, step, scenario.dynamics != "kinematic")
    a, b, _ = replace(model, b=car.steering.gain * model.b).with_commands()
    sensors = dict(scenario.sensors)
    rows: list[Floats] = []
    for channel in channels:
        row = np.zeros(len(a))
        row[_STATE_CHANNELS[channel][0]] = 1.0
        late = round(sensors[channel].delay / step) if channel in sensors else 0
        for _ in range(late):  # each step of delay is a state that holds the last value
            a = np.block([[a, np.zeros((len(a), 1))], [row, np.zeros((1, 1))]])
            b = np.vstack([b, np.zeros((1, 1))])
            rows = [np.append(other, 0.0) for other in rows]
            row = np.eye(len(a))[-1]
        rows.append(row)
    return System(a, b, np.array(rows), np.zeros((len(channels), 1)), step)


def policy_of(policy: Any, scenario: Any, speed: float) -> tuple[System, tuple[str, ...]]:
    """Return a policy as a linear system around straight driving at ``speed``, and the channels that it reads.

    Input is what the channels show, output the road-wheel angle that the actuator is told, rad + left. The last of its
    states is its own last command: what the channel ``steering_command`` shows, and where a rate goes on from.

    Raises:
        ValueError: the policy reads channels that straight driving does not have, is not smooth there, or remembers
            what is not numbers.
    """
    names = [channel.name for channel in scenario.channels]
    for name in names:
        known = name in _STATE_CHANNELS or name in (_COMMAND, *_CONSTANT)
        if not known and not name.startswith("curvature_preview_"):
            raise ValueError(
                f"a scenario with the channel {name!r} is not allowed: straight driving does not decide it"
            )
    straight = np.zeros(len(names))
    straight[names.index("speed")] = speed
    told = _Told(policy, scenario)
    memory = told.settled(straight)
    places = [i for i, name in enumerate(names) if name in _STATE_CHANNELS or name == _COMMAND]
    changes = np.array([_STATE_CHANNELS.get(names[i], (0, _COMMAND_CHANGE))[1] for i in places])
    whole = told.slopes(straight, memory, places, changes, 1.0)
    half = told.slopes(straight, memory, places, changes, 0.5)
    size = np.abs(half).max()
    if not (np.isfinite(whole).all() and np.abs(whole - half).max() <= _LINEAR * size):
        raise ValueError(f"policy {called(policy)!r} is not smooth around straight driving at {speed:g} m/s")
    slopes = half.copy()
    n = memory.size
    order = [names[i] for i in places]
    inputs = tuple(name for name in order if name != _COMMAND)
    columns = [n + order.index(name) for name in inputs]
    # Rows of the slopes: the command, then the next memory. Its states: the memory, then the last command.
    own = slopes[:, n + order.index(_COMMAND)] if _COMMAND in order else np.zeros(n + 1)
    rows = np.vstack([slopes[1:], slopes[:1]])
    a = np.column_stack([rows[:, :n], np.append(own[1:], own[0])])
    c = np.append(slopes[0, :n], own[0])[None]
    used = [j for j, column in enumerate(columns) if np.abs(slopes[:, column]).max() > 0.0]
    columns = [columns[j] for j in used]
    system = System(a, rows[:, columns], c, slopes[:1, columns], scenario.control_step)
    return system, tuple(inputs[j] for j in used)


def called(policy: Any) -> str:
    """What to call a policy, which may be a user's own."""
    return str(getattr(policy, "name", type(policy).__name__))


class _Told:
    """What a policy commands (rad) and remembers, in double precision where it is a `SteeringPolicy`."""

    def __init__(self, policy: Any, scenario: Any) -> None:
        self._policy = policy
        self._names = [channel.name for channel in scenario.channels]
        self._rate = scenario.action == "steering_rate"
        self._scale = scenario.max_steering_rate * scenario.control_step if self._rate else scenario.max_steering_angle

    def __call__(self, rows: Floats, memory: Floats | None) -> tuple[Floats, Floats]:
        n = len(rows)
        if isinstance(self._policy, SteeringPolicy):
            at = dict(zip(self._names, np.ascontiguousarray(rows.T), strict=True))
            fresh: Any = memory is None
            kept = np.zeros((n, self._policy.memory)) if memory is None else memory
            command, following = self._policy.command(at, kept, fresh if memory is None else np.zeros(n, dtype=bool))
        else:
            started = None if memory is None else np.zeros(n, dtype=bool)
            action, following = self._policy.predict(rows, memory, started)
            command = np.asarray(action, dtype=np.float64)[:, 0] * self._scale
            if self._rate:
                command = command + rows[:, self._names.index(_COMMAND)]
        return np.asarray(command, dtype=np.float64), self._remembered(following, n)

    def _remembered(self, following: Any, n: int) -> Floats:
        """Return what a policy remembers as numbers, (n, memory)."""
        if following is None:
            return np.zeros((n, 0))
        if not isinstance(following, np.ndarray) or following.dtype.kind not in "fiub":
            raise ValueError(f"policy {called(self._policy)!r} remembers objects, not numbers: there is no linear loop")
        return following.astype(np.float64).reshape(n, -1)

    def settled(self, straight: Floats) -> Floats:
        """Return what the policy remembers after long straight driving, shape (memory,)."""
        _, memory = self(straight[None], None)
        for _ in range(_SETTLED if memory.size else 0):
            before = memory
            _, memory = self(straight[None], memory)
            if np.array_equal(before, memory):
                break
        return memory[0]

    def slopes(self, straight: Floats, memory: Floats, places: list[int], changes: Floats, share: float) -> Floats:
        """Return central differences of (command, next memory) over (memory, channels), shape (1 + n, n + channels)."""
        n = memory.size
        steps = share * np.concatenate([np.full(n, _MEMORY_CHANGE), changes])
        found = []
        for sign in (1.0, -1.0):
            rows = np.tile(straight, (n + len(places), 1))
            kept = np.tile(memory, (n + len(places), 1))
            kept[np.arange(n), np.arange(n)] += sign * steps[:n]
            rows[n + np.arange(len(places)), places] += sign * steps[n:]
            command, following = self(rows, kept if n else None)
            found.append(np.column_stack([command, following]))
        return np.asarray(((found[0] - found[1]) / (2.0 * steps[:, None])).T)
