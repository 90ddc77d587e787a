"""Other simulators: each in its own room, which nothing else of the package imports, behind its own extra."""

from __future__ import annotations

from importlib import import_module
from typing import Any

#: Environments behind adapters: the module that registers an id, and its record of the keywords.
ADAPTED: dict[str, tuple[str, str]] = {"lanekeep/Highway-v0": ("lanekeep_env.adapters.highway", "HighwayScenario")}


def full_ids() -> tuple[str, ...]:
    """Return their ids as `gym.make` takes them, with the module that it imports first."""
    return tuple(f"{module}:{name}" for name, (module, _) in ADAPTED.items())


def scenario_class(env_id: str) -> Any:
    """Return the record of an adapted environment's keywords; importing its module registers the id.

    Raises:
        ModuleNotFoundError: the other package is not installed; names the extra that brings it.
    """
    module, record = ADAPTED[env_id.rpartition(":")[2]]
    return getattr(import_module(module), record)
