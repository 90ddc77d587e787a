"""Classical lateral controllers as policies: ``make(name, scenario)`` gives an object with ``predict``.

Every policy is built from a scenario alone (vehicle, channels, control step), never from an environment:

    >>> from lanekeep_env.scenario import LaneKeepScenario
    >>> policy = make("pd", LaneKeepScenario())
    >>> action, state = policy.predict([0.5, 0.0, 0.0, 20.0, 0.0, 0.0])
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from lanekeep_baselines.declared import PREFIX, Declared
from lanekeep_baselines.one_by_one import OneByOne
from lanekeep_baselines.policy import DrivingPolicy, Policy, Scenario, SteeringPolicy
from lanekeep_baselines.tunable import read_tuned, tuned
from lanekeep_env.checks import known, nearest, shown, shown_path

__all__ = ["DrivingPolicy", "OneByOne", "Policy", "Scenario", "SteeringPolicy", "load", "make", "names", "register"]

# Modules import the packages of their designs where they design: what they declare is read without them.
_POLICIES = {
    "pd": "pd:ProportionalDerivative",
    "pure-pursuit": "pure_pursuit:PurePursuit",
    "pure-pursuit-understeer": "pure_pursuit:PurePursuitUndersteer",
    "stanley": "stanley:Stanley",
    "knightriders-pi": "knightriders:KnightRidersPi",
    "knightriders-pi-as-driven": "knightriders:KnightRidersPiAsDriven",
    "knightriders-pi-state": "knightriders:KnightRidersPiState",
    "knightriders-pi-state-as-driven": "knightriders:KnightRidersPiStateAsDriven",
    "knightriders-cascade-published": "knightriders:KnightRidersCascadePublished",
    "knightriders-cascade-as-driven": "knightriders:KnightRidersCascadeAsDriven",
    "knightriders-cascade": "knightriders:KnightRidersCascade",
    "knightriders-cascade-kalman": "knightriders:KnightRidersCascadeKalman",
    "knightriders-pd": "knightriders:KnightRidersPd",
    "knightriders-pd-as-driven": "knightriders:KnightRidersPdAsDriven",
    "traechtler-pd": "traechtler:TraechtlerPd",
    "traechtler-p": "traechtler:TraechtlerP",
    "traechtler-pd-lowered": "traechtler:TraechtlerPdLowered",
    "traechtler-blind": "traechtler_blind:TraechtlerBlind",
    "traechtler-inverse": "traechtler_blind:TraechtlerInverse",
    "werling-lateral": "werling:WerlingLateral",
    "werling-lateral-ahead": "werling:WerlingLateralAhead",
    "werling-lateral-predictor": "werling_predictor:WerlingLateralPredictor",
    "werling-reverse": "werling:WerlingReverse",
    "werling-reverse-ahead": "werling:WerlingReverseAhead",
    "werling-drive": "werling_multi:WerlingDrive",
    "werling-traffic": "werling_traffic:WerlingTraffic",
    "yin-lqr": "yin:YinLqr",
    "yin-lqr-observer-printed": "yin:YinLqrObserverPrinted",
    "yin-lqr-observer": "yin:YinLqrObserver",
    "yin-lqr-feedforward": "yin:YinLqrFeedforward",
    "lane-support": "lane_support:LaneSupport",
    "lq-preview": "lq:LqPreview",
    "lq-preview-offset-free": "lq:LqPreviewOffsetFree",
    "lq-preview-trimmed": "lq_trimmed:LqPreviewTrimmed",
    "mpc-preview": "mpc:MpcPreview",
    "lqg": "lq:LinearQuadraticGaussian",
    "knightriders-circuit": "knightriders_circuit:KnightRidersCircuit",
    "knightriders-obstacles": "knightriders_obstacles:KnightRidersObstacles",
    "knightriders-obstacles-published": "knightriders_obstacles_published:KnightRidersObstaclesPublished",
    "knightriders-park": "knightriders_park:KnightRidersPark",
    "knightriders-shunt": "knightriders_shunt:KnightRidersShunt",
    "knightriders-park-published": "knightriders_park_published:KnightRidersParkPublished",
    "knightriders-modes": "knightriders_modes:KnightRidersModes",
    "highway-built-in": "highway:HighwayBuiltIn",
    "highway-p": "highway:HighwayP",
    "highway-zero": "highway:HighwayZero",
}


#: Controllers of users by name: what they declare, and the factory.
_REGISTERED: dict[str, tuple[type[Declared], Callable[[Any], Any]]] = {}


def register(name: str, factory: Callable[[Any], Any], needs: Sequence[str] = ()) -> None:
    """Make a controller of your own known to `names`, `make` and the benchmark, in this process.

    Args:
        name: anything that no other policy is called, but not ``slip-limited+...``; the same name again takes the new
            factory.
        factory: takes a scenario, gives a policy: an object with ``predict``. A `SteeringPolicy` declares itself.
        needs: channels that it cannot do without; `names(scenario)` lists it where they are observed.

    Raises:
        ValueError: a name that the package's own policies have, or a factory that is none.
    """
    if name in _POLICIES or not name.isprintable() or not name or "," in name or ":" in name:
        raise ValueError(f"name={shown(name)} is not allowed: it must be a text without , and : and none of {names()}")
    if name.startswith(PREFIX):
        raise ValueError(f"name={shown(name)} is not allowed: {PREFIX} stands before the name of any policy")
    if not callable(factory):
        raise ValueError(f"factory={shown(factory)} is not allowed: it must take a scenario and return a policy")
    if isinstance(factory, type) and issubclass(factory, Declared):
        declared: type[Declared] = factory
    else:
        actions = getattr(factory, "actions", 1)
        declared = type("Registered", (Declared,), {"name": name, "reads": tuple(needs), "actions": actions})
    _REGISTERED[name] = declared, factory


def registered(name: str) -> Callable[[Any], Any] | None:
    """Return the factory that was registered under ``name``, or None."""
    return _REGISTERED[name][1] if name in _REGISTERED else None


def names(scenario: Scenario | None = None) -> tuple[str, ...]:
    """Return the names that `make` knows, or those of them that can drive ``scenario`` with what is installed."""
    if scenario is None:
        return (*_POLICIES, *_REGISTERED)
    return tuple(name for name in names() if _drives(name, scenario))


def _drives(name: str, scenario: Scenario) -> bool:
    policy = policy_class(name)
    return not policy.lacking(scenario) and not policy.missing_package()


def policy_class(name: str) -> type[Declared]:
    """Return the class behind a name that `names` knows, with what it declares."""
    return _REGISTERED[name][0] if name in _REGISTERED else _class_of(name)


def _class_of(name: str) -> type[SteeringPolicy]:
    module, policy = _POLICIES[name].split(":")
    found: type[SteeringPolicy] = getattr(import_module(f"lanekeep_baselines.{module}"), policy)
    return found


def make(name: str, scenario: Scenario, **options: float) -> Policy:
    """Design the controller ``name`` for the vehicle, the channels and the control step of ``scenario``.

    ``options`` switch off, with False, what its class takes by keyword, improvements on a published controller, or give
    what it declares as tunable another value: ``make("pd", scenario, lateral_gain=0.05)``.

    Raises:
        ValueError: unknown name (the nearest one is named) or option, or a channel or field that the scenario does not
            have.
        ModuleNotFoundError: the controller's design needs a package of the extra `lanekeep[baselines]`.
    """
    if name not in names():
        raise ValueError(f"policy={shown(name)} is unknown{nearest(name, names())}; allowed: {', '.join(names())}")
    policy = policy_class(name)
    switches = () if name in _REGISTERED else policy.options()
    numbers = {option: value for option, value in options.items() if option not in switches}
    for option, value in options.items():
        allowed = (*switches, *(one.name for one in policy.tunable))
        if option not in allowed:
            raise ValueError(f"policy {name!r} has no option {shown(option)}; allowed: {', '.join(allowed) or 'none'}")
        if option in switches and not isinstance(value, bool):
            raise ValueError(f"{option}={shown(value)} is not allowed: it must be True or False")
    package = policy.missing_package()
    if package:
        raise ModuleNotFoundError(
            f'policy {name!r} needs the package {package!r}: pip install "lanekeep[baselines]"', name=package
        )
    factory: Callable[..., Any] = _REGISTERED[name][1] if name in _REGISTERED else policy
    if numbers:
        factory = tuned(policy, numbers)
    if name in _REGISTERED and (lacking := policy.lacking(scenario)):
        raise ValueError(lacking)
    made: Policy = factory(scenario, **{option: options[option] for option in switches if option in options})
    return made


def load(path: str | Path, scenario: Scenario) -> Policy:
    """Make the controller that `lanekeep tune` found and wrote to a file, for ``scenario``.

    Raises:
        ValueError: it is no such file, or holds what `make` refuses. OSError: it may not be read.
    """
    found = read_tuned(path)
    if found.policy not in names():
        raise ValueError(f"{shown_path(path)}: policy={shown(found.policy)} is unknown{nearest(found.policy, names())}")
    try:
        allowed = [one.name for one in policy_class(found.policy).tunable]
        known(f"policy {found.policy!r}", found.values, allowed, "tunable number")
        return make(found.policy, scenario, **found.values)
    except ValueError as error:
        raise ValueError(f"{shown_path(path)}: {error}") from None
