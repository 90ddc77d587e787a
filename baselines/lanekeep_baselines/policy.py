"""What every controller shares: the policy's interface, batches, channels by name, commands into actions.

A policy is a pure function: state in, state out, nothing mutated, nothing remembered in the object. Its
rows are independent of each other to the last bit: everything is an elementwise operation over the rows
(a matrix product would let the batch size choose the order of the additions).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_baselines.declared import Declared
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.scenario import Channel

Floats = NDArray[np.float64]


class Scenario(Protocol):
    """What a controller may know: nominal vehicle, channels, control step and the scale of the actions.

    `lanekeep_env.scenario.RoadScenario` is one; units and meanings are told there.
    """

    @property
    def vehicle(self) -> VehicleParameters: ...
    @property
    def channels(self) -> Sequence[Channel]: ...
    @property
    def control_step(self) -> float: ...
    @property
    def action(self) -> str: ...
    @property
    def max_steering_angle(self) -> float: ...
    @property
    def max_steering_rate(self) -> float: ...


class TyreScenario(Scenario, Protocol):
    """What a controller that knows whether its car slips may know besides."""

    @property
    def dynamics(self) -> str: ...


class PreviewScenario(Scenario, Protocol):
    """What a controller that looks ahead may know besides."""

    @property
    def preview_interval(self) -> float: ...


class LaneScenario(TyreScenario, PreviewScenario, Protocol):
    """What a controller of lane keeping may know besides."""


class DrivingScenario(Scenario, Protocol):
    """What a controller that chooses its speed may know besides."""

    @property
    def max_speed(self) -> float: ...


class Policy(Protocol):
    """Observations to actions, as in Stable-Baselines3."""

    name: ClassVar[str]

    def predict(
        self,
        observation: ArrayLike,
        state: NDArray[Any] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], NDArray[Any] | None]:
        """Return actions (float32, last axis 1 or, with a speed, 2) and the next state for one observation or more."""
        ...


class SteeringPolicy(Declared):
    """A controller that asks for a road-wheel angle; subclasses declare what they need, and write `command`.

    Attributes:
        memory: numbers that it remembers from one step to the next, 0 for none.

    Raises:
        ValueError: the scenario lacks something that the policy declares.
    """

    memory: int = 0

    def __init__(self, scenario: Scenario) -> None:
        lacking = self.lacking(scenario)
        if lacking:
            raise ValueError(lacking)
        self._columns = len(scenario.channels)
        self._order = {channel.name: i for i, channel in enumerate(scenario.channels)}
        self._rate_mode = scenario.action == "steering_rate"
        self._scale = scenario.max_steering_angle
        if self._rate_mode:
            self._scale = scenario.max_steering_rate * scenario.control_step

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        """Return the road-wheel angle asked for, rad, + left, shape (n,), and the next memory.

        Args:
            at: each channel of the observation by name, float64, shape (n,).
            memory: (n, memory); meaningless in rows that are fresh. Never written to.
            fresh: rows in which an episode starts, (n,), or one answer for all rows.
        """
        raise NotImplementedError

    def predict(
        self,
        observation: ArrayLike,
        state: NDArray[Any] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], NDArray[Any] | None]:
        """Return actions in [-1, 1] while the command is within the scenario's bounds, and the next state.

        A command beyond the bounds gives an action beyond [-1, 1], which the environment clips; the policies
        learn of it from the channel `steering_command`.

        Args:
            observation: (channels,) or (n, channels).
            state: what the last call returned, (memory,) or (n, memory); None starts every row afresh.
            episode_start: () or (n,); rows that are true forget their state.
            deterministic: there is nothing random here; accepted for Stable-Baselines3's sake.

        Returns:
            Actions, float32, (1,) or (n, 1), with a speed (2,) or (n, 2); state, float64, or None without memory.

        Raises:
            ValueError: an observation or a state of another shape.
        """
        rows = np.asarray(observation)
        if rows.ndim not in (1, 2) or rows.shape[-1] != self._columns:
            raise ValueError(
                f"observation has shape {rows.shape}, allowed: ({self._columns},) or (n, {self._columns}), "
                "one number a channel of the scenario"
            )
        single = rows.ndim == 1
        columns = np.array(np.atleast_2d(rows).T, dtype=np.float64, order="C")
        at = {channel: columns[i] for channel, i in self._order.items()}
        n = columns.shape[1]
        fresh: NDArray[np.bool_] | bool = state is None
        memory = np.zeros((n, self.memory)) if state is None else np.atleast_2d(np.asarray(state, dtype=np.float64))
        if memory.shape != (n, self.memory):
            raise ValueError(f"state has shape {memory.shape}, allowed: {(n, self.memory)}, as predict returned it")
        if state is not None and episode_start is not None:
            fresh = np.broadcast_to(np.asarray(episode_start, dtype=bool).reshape(-1), (n,))
        action, following = self.actions_for(at, memory, fresh)
        if single:
            return action[0], None if following is None else following[0]
        return action, following

    def actions_for(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[NDArray[np.float32], Floats | None]:
        """Return actions (n, actions), float32, as `predict`, and the next memory; arguments as of `command`.

        Raises:
            TypeError: `command` returned something else than it must.
        """
        told = self.command(at, memory, fresh)
        if not (isinstance(told, tuple) and len(told) == 2):
            raise TypeError(
                f"{type(self).__name__}.command returned {type(told).__name__}; it must return two things, the "
                "commands (n,) and the next memory, None without one"
            )
        command, following, n = np.asarray(told[0]), told[1], len(memory)
        if command.shape[:1] != (n,):
            raise TypeError(
                f"{type(self).__name__}.command returned commands of the shape {command.shape}; allowed is ({n},), one "
                "a car"
            )
        return self._action(command, at).astype(np.float32), following

    def _action(self, command: Floats, at: Mapping[str, Floats]) -> Floats:
        """Return what `command` asks for in the units of the action, (n, actions)."""
        if self._rate_mode:
            command = command - at["steering_command"]
        return (command / self._scale)[:, None]


#: Way after which a command counts in full, m.
SETTLING_WAY = 0.1


def turned_on_the_way(command: Floats, before: Floats, speed: Floats, control_step: float) -> Floats:
    """Return what is asked for of a car that turns its wheels only as far as it drives, rad, (n,).

    A car that stands cannot come nearer to its path, and a law without regard for that steers after its sensors' noise.
    Of a new ``command`` the share |v| dt / `SETTLING_WAY` counts, the rest is the one ``before``: all of it from
    2 m/s on at a control step of 0.05 s, nothing of it at standstill.
    """
    share = np.minimum(np.abs(speed) * (control_step / SETTLING_WAY), 1.0)
    return np.where(share < 1.0, before + share * (command - before), command)


class DrivingPolicy(SteeringPolicy):
    """A controller that asks for a speed as well: `command` returns angle (rad) and set speed (m/s), (n, 2)."""

    actions = 2

    def __init__(self, scenario: DrivingScenario) -> None:
        super().__init__(scenario)
        self._fastest = scenario.max_speed

    def _action(self, command: Floats, at: Mapping[str, Floats]) -> Floats:
        steering = super()._action(command[:, 0], at)
        return np.concatenate([steering, command[:, 1:] / self._fastest], axis=1)
