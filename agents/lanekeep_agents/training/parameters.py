"""Further arguments of Stable-Baselines3's algorithms: which there are, and what each may be.

Those that are missing here are given by other settings, or would leave a state that no checkpoint keeps.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from lanekeep_env.checks import choose, require

#: More of anything is no training run, and more than memory holds.
_MOST = 100_000_000
_COUNT: dict[str, Any] = {"at_least": 1, "at_most": _MOST, "whole": True}
_OFF_POLICY: dict[str, dict[str, Any]] = {
    "buffer_size": _COUNT,
    "batch_size": _COUNT,
    "learning_starts": {"at_least": 0, "at_most": _MOST, "whole": True},
    "train_freq": _COUNT,
    "gradient_steps": {"at_least": -1, "at_most": _MOST, "whole": True},  # -1: as many as there were steps
    "tau": {"above": 0.0, "at_most": 1.0},
}
#: Bounds of each argument of each algorithm.
_BOUNDS: dict[str, dict[str, dict[str, Any]]] = {
    "ppo": {
        "n_steps": _COUNT,
        "batch_size": {"at_least": 2, "at_most": _MOST, "whole": True},
        "n_epochs": _COUNT,
        "gae_lambda": {"at_least": 0.0, "at_most": 1.0},
        "clip_range": {"above": 0.0},
        "ent_coef": {"at_least": 0.0},
        "vf_coef": {"at_least": 0.0},
        "max_grad_norm": {"above": 0.0},
    },
    "sac": {**_OFF_POLICY, "ent_coef": {"at_least": 0.0}, "target_entropy": {}, "target_update_interval": _COUNT},
    "td3": {
        **_OFF_POLICY,
        "policy_delay": _COUNT,
        "target_policy_noise": {"at_least": 0.0},
        "target_noise_clip": {"at_least": 0.0},
    },
}
#: SAC's arguments that it can find itself, and how that is written.
_AUTOMATIC = {"ent_coef": r"auto(_\d+(\.\d+)?)?", "target_entropy": "auto"}


def check_parameters(algorithm: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments with whole numbers as ints.

    Raises:
        ValueError: an argument that the algorithm does not take, or a value that is not allowed.
    """
    checked = dict(parameters)
    for name, value in parameters.items():
        choose("parameters", name, _BOUNDS[algorithm])
        bounds = _BOUNDS[algorithm][name]
        if algorithm == "sac" and isinstance(value, str) and re.fullmatch(_AUTOMATIC.get(name, "(?!)"), value):
            continue
        require(f"parameters.{name}", value, 'or "auto"' if algorithm == "sac" and name in _AUTOMATIC else "", **bounds)
        if bounds.get("whole"):
            checked[name] = int(value)
    return checked
