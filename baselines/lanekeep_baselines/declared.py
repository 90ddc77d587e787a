"""What a policy declares of the scenarios that it can drive, and what a scenario lacks of it: no design is made.

Its class says it in one place: the channels that it ``reads`` and ``uses``, what else it ``needs``, the ``packages`` of
its design and the numbers of an action. The fields are those of the protocol that annotates ``scenario`` in its
``__init__``, which mypy holds the code to.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from inspect import Parameter, signature
from typing import Any, ClassVar, NamedTuple, get_type_hints

from lanekeep_baselines.tunable import Tunable
from lanekeep_env.checks import shown

#: What stands before the name of a policy behind the filter of `slip_limit`; no policy's own name begins so.
PREFIX = "slip-limited+"


class Need(NamedTuple):
    """A condition on a scenario beyond its channels and fields.

    Attributes:
        what: in a few words.
        lacking: takes a scenario, gives how "policy 'x' needs ..." goes on where it is not met, else "".
    """

    what: str
    lacking: Callable[[Any], str]


class Declared:
    """What `lanekeep_baselines.names` and `make` go by.

    Attributes:
        name: what `lanekeep_baselines.make` calls it.
        reads: channels that it cannot do without; where the action is a rate, ``steering_command`` besides.
        uses: channels that it reads where they are there; with a * at the end, all that begin so.
        needs: further conditions.
        packages: that its design imports.
        actions: numbers of an action.
        tunable: constants that `lanekeep tune` may change; published controllers have none.
    """

    name: ClassVar[str]
    reads: ClassVar[tuple[str, ...]]
    uses: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[tuple[Need, ...]] = ()
    packages: ClassVar[tuple[str, ...]] = ()
    actions: ClassVar[int] = 1
    tunable: ClassVar[tuple[Tunable, ...]] = ()

    @classmethod
    def fields(cls) -> tuple[str, ...]:
        """Return the fields of a scenario that it may read."""
        protocol = get_type_hints(cls.__init__).get("scenario", object)
        bases = reversed(protocol.__mro__)
        return tuple(name for base in bases for name, member in vars(base).items() if isinstance(member, property))

    @classmethod
    def options(cls) -> tuple[str, ...]:
        """Return the switches that `lanekeep_baselines.make` takes, all on by default: arguments by keyword only."""
        parameters = signature(cls.__init__).parameters.values()
        return tuple(parameter.name for parameter in parameters if parameter.kind is Parameter.KEYWORD_ONLY)

    @classmethod
    def lacking(cls, scenario: Any) -> str:
        """Return the one-line error that tells why ``scenario`` cannot be driven, "" where it can; microseconds."""
        if not hasattr(scenario, "channels"):
            return f"scenario={shown(scenario)} is none; pass env.unwrapped.scenario"
        asked = getattr(scenario, "num_actions", 1)
        if asked != cls.actions:
            return (
                f"policy {cls.name!r} gives {cls.actions} number(s) an action, the scenario asks for {asked}; "
                "allowed: what names(scenario) lists"
            )
        channels = [channel.name for channel in scenario.channels]
        for channel in (*cls.reads, "steering_command") if scenario.action == "steering_rate" else cls.reads:
            if channel not in channels:
                hint = ": make the scenario with preview=1 or more" if channel.startswith("curvature_preview") else ""
                return (
                    f"policy {cls.name!r} needs the channel {channel!r}, which the scenario does not observe{hint}; "
                    f"channels: {', '.join(channels)}"
                )
        for field in cls.fields():
            if not hasattr(scenario, field):
                return (
                    f"policy {cls.name!r} is not for {type(scenario).__name__}, which has no {field!r}; "
                    "allowed: what names(scenario) lists"
                )
        lacking = next(filter(None, (need.lacking(scenario) for need in cls.needs)), "")
        return lacking and f"policy {cls.name!r} needs {lacking}"

    @classmethod
    def missing_package(cls) -> str:
        """Return the first package of its design that is not installed, or ""."""
        return next((package for package in cls.packages if find_spec(package) is None), "")
