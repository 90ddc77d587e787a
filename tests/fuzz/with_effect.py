"""Keywords that matter beside each other: what a scenario refuses as having no effect is left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import lanekeep_env


def scenario_class(env_id: str) -> Any:
    """Return the class of an id's scenarios."""
    return lanekeep_env.ENVIRONMENTS[env_id].scenario


def with_effect(env_id: str, keywords: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keywords, and the entries of mappings among them, that are not refused as having no effect."""
    record, kept = scenario_class(env_id), dict(keywords)
    known = {field.name for field in fields(record)}
    while True:
        try:
            record.from_keywords(**{name: value for name, value in kept.items() if name in known})
        except ValueError as error:
            path, _, rest = str(error).partition("=")
            if " has no effect in this scenario: " not in rest:
                return kept
            top, _, inner = path.partition(".")
            if inner:
                kept[top] = {name: value for name, value in kept[top].items() if name != inner}
            else:
                del kept[top]
        else:
            return kept
