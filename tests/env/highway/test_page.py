"""The page for highway-env's users does what it says."""

import re
from pathlib import Path

import lanekeep_agents
from lanekeep_benchmarks.suites import SUITES
from lanekeep_env.adapters.highway import HighwayScenario

PAGE = (Path(__file__).parents[3] / "docs" / "highway-env.md").read_text()


def test_its_blocks_run():
    scope = {}
    for text in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        exec(compile(text, "highway-env.md", "exec"), scope)
    assert scope["total"] > 85.0 and not scope["terminated"]  # at most 1 a step
    assert len(scope["world"].network.lanes_list()) == 2


def test_its_table_has_the_policies_of_the_suites():
    suite = SUITES["highway"]
    rows = re.findall(r"^\| `([a-z0-9-]+)` \|(?: *−?\d)", PAGE, flags=re.MULTILINE)
    learned = lanekeep_agents.names(HighwayScenario(**suite.scenarios[0].keywords))
    assert learned and set(rows) == {*suite.policies, *learned} and rows[0] == suite.reference
    assert SUITES["racetrack"].policies == suite.policies
