"""A learned policy's record meets a scenario: which columns it reads, and what its actions mean there."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import lanekeep_baselines
from lanekeep_agents.foreign import one_line, refuse_files
from lanekeep_agents.policy_record import InputChannel, PolicyRecord
from lanekeep_env import ENVIRONMENTS, __version__
from lanekeep_env.adapters import scenario_class
from lanekeep_env.checks import nearest, shown
from lanekeep_env.scenario.car import CarScenario


class Binding:
    """A record bound to a scenario.

    Args:
        record: of the policy.
        scenario: to drive, by default the one trained on.
        allow_files: let the one trained on read the road or the world whose file it names.

    Attributes:
        columns: of the scenario's observation, in the order of the policy's inputs.
        width: channels of the scenario.
        scenario: that is driven.

    Raises:
        ValueError: the scenario lacks a channel or means something else by it, or has another control step or
            another number of actions.
    """

    def __init__(self, record: PolicyRecord, scenario: CarScenario | None = None, *, allow_files: bool = False) -> None:
        if scenario is None:
            scenario = trained_scenario(record, allow_files)
        if not hasattr(scenario, "channels"):
            raise ValueError(f"scenario={shown(scenario)} is none; pass env.unwrapped.scenario")
        self._record, self.scenario = record, scenario
        _check(record, scenario)
        order = {channel.name: i for i, channel in enumerate(scenario.channels)}
        self.width = len(order)
        wanted = [_column(record, channel, scenario, order) for channel in record.channels]
        # A slice is copied several times as fast as what an index picks.
        run = slice(wanted[0], wanted[0] + len(wanted))
        in_a_row = wanted == list(range(run.start, run.stop))
        self.columns: slice | NDArray[np.intp] = run if in_a_row else np.array(wanted, dtype=np.intp)
        self._converts = not _same_action(record, scenario)
        self._command = order.get("steering_command", -1)
        if self._converts and "steering_rate" in (record.action, scenario.action) and self._command < 0:
            raise ValueError(
                f"policy {record.name!r} needs the channel 'steering_command' to turn its {record.action} into the "
                f"scenario's {scenario.action}; channels: {one_line(', '.join(order))}"
            )

    def has_base(self) -> bool:
        """Tell whether there are bases that can drive the scenario, or none is asked for; nothing is designed."""
        wanted = self._record.bases
        try:
            return not wanted or set(wanted) <= set(lanekeep_baselines.names(self._base_scenario()))
        except ValueError:
            return False

    def make_bases(self) -> list[lanekeep_baselines.Policy]:
        """Make the classical policies that the record asks for; ValueError where one of them cannot drive."""
        return [self._made(name) for name in self._record.bases]

    def _made(self, name: str) -> lanekeep_baselines.Policy:
        try:
            return _designed(name, self._base_scenario())
        except (ValueError, ArithmeticError) as error:
            raise ValueError(f"policy {self._record.name!r}: base={shown(name)}: {one_line(error)}") from None

    def _base_scenario(self) -> CarScenario:
        """The scenario with the action trained on, so that both meanings of the base, input and sum, stay the same.

        Raises:
            ValueError: its action is settled, and another one.
        """
        record, scenario = self._record, self.scenario
        if not self._converts:
            return scenario
        if "action" not in {field.name for field in fields(scenario)}:  # an adapter's
            raise ValueError(
                f"policy {record.name!r}: max_steering_angle={shown(record.max_steering_angle)} is not allowed with "
                f"base={shown(record.bases[0])} in this scenario, whose actions are angles up to "
                f"{scenario.max_steering_angle:.6g} rad"
            )
        return replace(
            scenario,
            action=record.action,
            max_steering_angle=record.max_steering_angle,
            max_steering_rate=record.max_steering_rate,
        )

    def given(self, observation: ArrayLike) -> NDArray[np.float32]:
        """Return an observation of the scenario as an array, (channels,) or (n, channels).

        Raises:
            ValueError: it has another shape.
        """
        found = np.asarray(observation, dtype=np.float32)
        if found.ndim not in (1, 2) or found.shape[-1] != self.width:
            raise ValueError(
                f"observation has shape {found.shape}, allowed: ({self.width},) or (n, {self.width}), "
                "one number a channel of the scenario"
            )
        return found

    def convert(self, action: NDArray[np.float32], observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions in [-1, 1] that ask the scenario for what the policy asked its own one for.

        Args:
            action: (n, actions), in [-1, 1] of the scenario trained on.
            observation: (n, channels) of the scenario.
        """
        if not self._converts:
            return action
        trained, scenario = self._record, self.scenario
        before = observation[:, self._command].astype(np.float64)
        command = action[:, 0] * np.float64(trained.max_steering_angle)
        if trained.action == "steering_rate":
            command = before + action[:, 0] * np.float64(trained.max_steering_rate * trained.control_step)
            command.clip(-trained.max_steering_angle, trained.max_steering_angle, out=command)
        asked = command / scenario.max_steering_angle
        if scenario.action == "steering_rate":
            asked = (command - before) / (scenario.max_steering_rate * scenario.control_step)
        converted = action.copy()
        converted[:, 0] = asked.clip(-1.0, 1.0)
        return converted


#: Controllers by name, kind and hash of the scenario, and how many are kept.
_DESIGNED: dict[tuple[str, type, str], lanekeep_baselines.Policy] = {}
_MOST_DESIGNED = 64


def _designed(name: str, scenario: CarScenario) -> lanekeep_baselines.Policy:
    """A controller has no state: whoever makes a policy again and again, as training does, designs it once."""
    key = name, type(scenario), scenario.hash
    if key not in _DESIGNED:
        designed = lanekeep_baselines.make(name, scenario)
        if len(_DESIGNED) == _MOST_DESIGNED:
            _DESIGNED.pop(next(iter(_DESIGNED)))
        _DESIGNED[key] = designed
    return _DESIGNED[key]


def _record_of(record: PolicyRecord) -> Any:
    """The record of the keywords of the environment that a policy was trained in."""
    if record.env_id in ENVIRONMENTS:
        return ENVIRONMENTS[record.env_id].scenario
    return scenario_class(record.env_id)


def trained_scenario(record: PolicyRecord, allow_files: bool = False) -> CarScenario:
    """Build the scenario that a policy was trained on; a file that it names is only read where that is allowed."""
    if not allow_files:
        refuse_files(record)
    kind = _record_of(record)
    allowed = [field.name for field in fields(kind)]
    for name in record.scenario:
        if name not in allowed:
            written = record.training.versions.get("lanekeep", "unknown")
            raise ValueError(
                f"policy {record.name!r}: scenario has no field {shown(name)}{nearest(name, allowed)}; {record.env_id} "
                f"of lanekeep {__version__} has {', '.join(allowed)} (it was trained by version {shown(written)})"
            )
    try:
        return kind.from_keywords(**record.scenario)
    except (TypeError, ValueError, ArithmeticError) as error:
        raise ValueError(
            f"policy {record.name!r}: scenario is not one of {record.env_id} ({one_line(error)})"
        ) from None


def _check(record: PolicyRecord, scenario: CarScenario) -> None:
    for field, trained, found in (
        ("actions", record.actions, scenario.num_actions),
        ("control_step", record.control_step, scenario.control_step),
        ("max_speed", record.scenario.get("max_speed"), getattr(scenario, "max_speed", None)),
    ):
        if trained != found:
            raise ValueError(
                f"policy {record.name!r} is not for a scenario with {field}={shown(found)}; allowed: {shown(trained)}"
            )


def _column(record: PolicyRecord, wanted: InputChannel, scenario: CarScenario, order: dict[str, int]) -> int:
    """The column of a channel that means the same."""
    if wanted.name not in order:
        raise ValueError(
            f"policy {record.name!r} needs the channel {shown(wanted.name)} ({shown(wanted.description)}), which the "
            f"scenario does not observe; channels: {one_line(', '.join(order))}"
        )
    found = scenario.channels[order[wanted.name]]
    for field in ("unit", "low", "high", "description"):
        told, trained = getattr(found, field), getattr(wanted, field)
        if field == "description" and told != trained:
            trained = _described(record).get(wanted.name, trained)
        if trained is not None and told != trained:
            raise ValueError(
                f"policy {record.name!r}: the scenario's channel {shown(wanted.name)} has the {field} "
                f"{told!r}, allowed: {shown(trained)}"
            )
    return order[wanted.name]


def _described(record: PolicyRecord) -> dict[str, str]:
    """What the channels trained on mean, in today's words: those of the file may be an older version's.

    Neither road nor world, nor the car, which may name files, say anything of them.
    """
    values = {name: value for name, value in record.scenario.items() if name not in ("road", "world", "vehicle")}
    try:
        scenario = _record_of(record)(**values)
    except (TypeError, ValueError, ArithmeticError):
        return {}
    return {channel.name: channel.description for channel in scenario.channels}


def _same_action(record: PolicyRecord, scenario: CarScenario) -> bool:
    """Whether an action asks both scenarios for the same."""
    fields = ["action", "max_steering_angle"]
    if record.action == "steering_rate":
        fields.append("max_steering_rate")
    return all(getattr(record, field) == getattr(scenario, field) for field in fields)
