"""Classical lateral controllers as policies: ``make(name, scenario)`` gives an object with ``predict``.

Every policy is built from a scenario alone (vehicle, channels, control step), never from an environment:

    >>> from lanekeep_env.scenario import LaneKeepScenario
    >>> policy = make("pd", LaneKeepScenario())
    >>> action, state = policy.predict([0.5, 0.0, 0.0, 20.0, 0.0, 0.0])
"""

from __future__ import annotations

from importlib import import_module

from lanekeep_baselines.policy import Policy, Scenario
from lanekeep_env.checks import nearest, shown

__all__ = ["Policy", "Scenario", "make", "names"]

# Modules are imported when a policy is made: `pd` runs without python-control, and names() costs nothing.
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
    "traechtler-pd-lowered": "traechtler:TraechtlerPdLowered",
    "traechtler-blind": "traechtler_blind:TraechtlerBlind",
    "traechtler-inverse": "traechtler_blind:TraechtlerInverse",
    "werling-lateral": "werling:WerlingLateral",
    "werling-lateral-ahead": "werling:WerlingLateralAhead",
    "werling-lateral-predictor": "werling_predictor:WerlingLateralPredictor",
    "werling-reverse": "werling:WerlingReverse",
    "werling-reverse-ahead": "werling:WerlingReverseAhead",
    "werling-drive": "werling:WerlingDrive",
    "yin-lqr": "yin:YinLqr",
    "yin-lqr-observer-printed": "yin:YinLqrObserverPrinted",
    "yin-lqr-observer": "yin:YinLqrObserver",
    "yin-lqr-feedforward": "yin:YinLqrFeedforward",
    "lq-preview": "lq:LqPreview",
    "lq-preview-offset-free": "lq:LqPreviewOffsetFree",
    "lqg": "lq:LinearQuadraticGaussian",
    "knightriders-circuit": "knightriders_circuit:KnightRidersCircuit",
}


def names(scenario: Scenario | None = None) -> tuple[str, ...]:
    """Return the names that `make` knows, or those of them that can drive ``scenario`` with what is installed."""
    if scenario is None:
        return tuple(_POLICIES)
    return tuple(name for name in _POLICIES if _drives(name, scenario))


def _drives(name: str, scenario: Scenario) -> bool:
    try:
        make(name, scenario)
    except (ValueError, ModuleNotFoundError):
        return False
    return True


def make(name: str, scenario: Scenario) -> Policy:
    """Design the controller ``name`` for the vehicle, the channels and the control step of ``scenario``.

    Raises:
        ValueError: unknown name (the nearest one is named), or a channel or field that the scenario does not have.
        ModuleNotFoundError: the controller's design needs a package of the extra `lanekeep[baselines]`.
    """
    if name not in _POLICIES:
        raise ValueError(f"policy={shown(name)} is unknown{nearest(name, _POLICIES)}; allowed: {', '.join(_POLICIES)}")
    if not hasattr(scenario, "channels"):
        raise ValueError(f"scenario={shown(scenario)} is none; pass env.unwrapped.scenario")
    module, record = _POLICIES[name].split(":")
    try:
        build = getattr(import_module(f"lanekeep_baselines.{module}"), record)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in ("control", "scipy"):
            raise
        raise ModuleNotFoundError(
            f'policy {name!r} needs the package {error.name!r}: pip install "lanekeep[baselines]"', name=error.name
        ) from error
    try:
        policy: Policy = build(scenario)
    except AttributeError as error:
        if error.obj is not scenario:
            raise
        raise ValueError(
            f"policy {name!r} is not for {type(scenario).__name__}, which has no {error.name!r}; "
            "allowed: what names(scenario) lists"
        ) from error
    return policy
