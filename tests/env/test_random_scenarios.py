"""A small draw of `make fuzz`: random scenarios are refused in one line, or driven and finite."""

import importlib.util
import sys
from pathlib import Path

import numpy as np

_SPEC = importlib.util.spec_from_file_location("fuzz_scenarios", Path(__file__).parents[1] / "fuzz" / "scenarios.py")
scenarios = importlib.util.module_from_spec(_SPEC)
sys.modules[_SPEC.name] = scenarios  # dataclasses look their module up
_SPEC.loader.exec_module(scenarios)


def test_random_scenarios_are_refused_or_driven():
    """Without sensors and backlash: each combination of those is a kernel of its own to compile."""
    found = {"refused": 0, "driven": 0}
    for number in range(100):
        alike = np.random.default_rng([1, number // 10, 10])
        case = scenarios.random_case(np.random.default_rng([1, number]), alike)
        case.keywords.pop("sensors", None)
        case.keywords.pop("scan", None)
        case.keywords.pop("effort", None)
        if isinstance(vehicle := case.keywords.get("vehicle"), dict):
            vehicle["steering"] |= {"backlash": 0.0, "feedback": "road_wheel"}
            vehicle["steering"]["lag"] = vehicle["steering"]["lag"] or 0.1
        kind, message = scenarios.outcome_of(case, vector=False)
        assert kind != "violation", f"case {number}: {case}: {message}"
        found[kind] += 1
    assert min(found.values()) > 20
