"""What is driven: every option of every environment alone, in each form, and some of them together."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from typing import Any

from side_by_side.checkouts import HERE
from side_by_side.drive import Case

#: Forms of an environment: a single one, some cars, and more than a block of the kernels (256).
COLUMNS = (0, 5, 300)
PRECISIONS = ("float64", "float32")
SENSOR_SETS = ("production", "poor")
_GEAR = {"lag": 0.1, "rate_limit": 0.4, "delay": 0.05, "backlash": 0.02, "feedback": "motor"}
#: Options beside each other, by what the ids have in common; the vehicle's gear is in every one.
TOGETHER: dict[str, tuple[dict[str, Any], ...]] = {
    "Wall": ({"scan": "kinect", "servo": {"left": 0.35, "right": 0.3, "ticks": 50}, "encoder_ticks": 40},),
    "Drive": (
        {
            "traffic": [(0, "speed", 8), (0.2, "lead", 12, 5.0), (0.5, "lead_gone"), (0.6, "stop", 20.0)],
            "slope": (-0.05, 0.05),
            "wind": (-5.0, 10.0),
        },
    ),
    "Traffic": ({"flow": {"cars": 6, "spacing": 20.0, "situation": "cut_in"}, "lanes": 2},),
    "LaneKeep": (
        {"dynamics": "kinematic", "preview": 4},
        {"tyre": "magic_formula", "preview": 4, "observation": "full"},
    ),
}
TOGETHER["Circuit"] = TOGETHER["Wall"]
QUICK = ("action", "sensors", "randomisation", "observation")


def options_module() -> Any:
    """The tables of every option of every id, with values beside its default, that the tests have."""
    sys.path[:0] = [str(HERE), str(HERE / "tests" / "env")]
    return import_module("registry_options")


def _alone(module: Any, options: dict[str, list[Any]], quick: bool) -> Iterator[dict[str, Any]]:
    """Each value, with what it takes beside it to have an effect: others are refused."""
    yield {}
    tried = {key: values for key, values in options.items() if key != "dtype" and (key in QUICK or not quick)}
    sensors = [value for value in (*options["sensors"], *SENSOR_SETS) if value != options["sensors"][0]]
    yield from module.alone({**tried, "sensors": sensors}, options)


def _together(env_id: str, options: dict[str, list[Any]]) -> Iterator[dict[str, Any]]:
    yield {"randomisation": "stress", "sensors": "poor"}
    base = next(value["base"] for value in options["vehicle"] if isinstance(value, dict))
    for more in next((sets for key, sets in TOGETHER.items() if key in env_id), ({},)):
        yield more | {"vehicle": {"base": base, "steering": _GEAR}, "randomisation": "stress", "sensors": "production"}
        yield more | {"vehicle": {"base": base, "steering": _GEAR}, "action": "steering_rate"}


def _modes(env_id: str, keywords: dict[str, Any]) -> Iterator[Case]:
    for mode in ("same_step", "disabled"):
        for columns in COLUMNS[1:]:
            yield Case(env_id, keywords, columns, 3, extra={"autoreset_mode": mode})


def cases_of(env_id: str, module: Any, quick: bool) -> list[Case]:
    """Cases of one id; ``quick`` drives its defaults and a handful of options in float64."""
    found, options = [], module.OPTIONS[env_id]
    for dtype in PRECISIONS[: 1 if quick else 2]:
        keywords = {"dtype": dtype}
        start = {"lateral_error": 0.02, "heading_error": -0.01}
        found += [Case(env_id, keywords, columns, 2, start=start) for columns in COLUMNS]
        found += _modes(env_id, keywords)
        sets = [*_alone(module, options, quick), *([] if quick else _together(env_id, options))]
        found += [Case(env_id, keywords | more, columns, 1) for more in sets for columns in COLUMNS]
        if not quick:
            found += _modes(env_id, keywords | {"randomisation": "stress", "sensors": "poor"})
            found.append(Case(env_id, keywords, COLUMNS[-1], 4, extra={"num_threads": 2}))
    return found


def all_cases(quick: bool, only: str | None) -> dict[str, list[Case]]:
    """Cases by id; ValueError if ``only`` is none of them."""
    module = options_module()
    table = module.OPTIONS
    ids = [env_id for env_id in table if only in (None, env_id, env_id.partition("/")[2])]
    if not ids:
        raise ValueError(f"--only {only!r} is no environment; allowed: {', '.join(table)}")
    return {env_id: cases_of(env_id, module, quick) for env_id in ids}
