"""The page for highway-env's users does what it says."""

import re
from pathlib import Path

from lanekeep_benchmarks.suites import SUITES

PAGE = (Path(__file__).parents[3] / "docs" / "highway-env.md").read_text()


def test_its_blocks_run():
    scope = {}
    for text in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        exec(compile(text, "highway-env.md", "exec"), scope)
    assert scope["total"] > 85.0 and not scope["terminated"]  # at most 1 a step
    assert len(scope["world"].network.lanes_list()) == 2


def test_its_table_has_the_policies_of_the_suite():
    suite = SUITES["highway"]
    rows = re.findall(r"^\| `([a-z-]+)` \|(?: *−?\d)", PAGE, flags=re.MULTILINE)
    assert set(rows) == set(suite.policies) and rows[0] == suite.reference
