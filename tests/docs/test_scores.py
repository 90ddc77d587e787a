"""The scores on the environments' pages are those that come out when the policies drive."""

import json
import re
import sys
from pathlib import Path

import pytest

import lanekeep_agents
import lanekeep_baselines
import lanekeep_env

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS))
try:
    import reference
    import scores
finally:
    sys.path.remove(str(DOCS))

FILE = json.loads((DOCS / "scores.json").read_text(encoding="utf-8"))
SUITES = {suite.scenarios[0].env_id: suite for suite in scores.nominal()}
#: Half a minute and more for a policy.
DEAR = {"lanekeep/Drive-v0", "lanekeep/Traffic-v0", "lanekeep/Circuit-v0", "lanekeep/ObstacleCircuit-v0"}
DEAR |= {"lanekeep/ParallelPark-v0"}


def test_every_environment_of_the_suite_has_scores_of_what_is_shipped():
    assert FILE["environments"].keys() == SUITES.keys() <= lanekeep_env.ENVIRONMENTS.keys()
    known = {*lanekeep_baselines.names(), *lanekeep_agents.names()}
    for measured in FILE["environments"].values():
        assert measured["policies"].keys() <= known and measured["policies"]
    assert (FILE["suite"], FILE["episodes"], FILE["seed"]) == ("lanekeep-2026.1", 64, 0)
    assert re.fullmatch(r"measured at [0-9a-f]{7,} on \d{4}-\d\d-\d\d by `make tables`", FILE["measured"])


def check(env_id, policies):
    """What ``policies`` score now is what the file has."""
    there = FILE["environments"][env_id]["policies"]
    for name, row in scores.scores(SUITES[env_id], policies).items():
        assert row.keys() == there[name].keys()
        for key, numbers in row.items():
            assert there[name][key] == pytest.approx(numbers, rel=1e-6, abs=1e-9), (name, key)


@pytest.mark.parametrize(("number", "env_id"), [*enumerate(one for one in SUITES if one not in DEAR)])
def test_no_score_is_written_by_hand(number, env_id):
    """One policy of each, another one for each environment."""
    policies = sorted(FILE["environments"][env_id]["policies"])
    check(env_id, [policies[number % len(policies)]])


@pytest.mark.slow
@pytest.mark.parametrize("env_id", SUITES)
def test_no_score_of_any_policy_is_written_by_hand(env_id):
    able = scores.able(SUITES[env_id])
    assert {*able} == FILE["environments"][env_id]["policies"].keys()
    check(env_id, able)


def test_a_page_shows_them_as_they_are(monkeypatch):
    row = {"failure_rate": [0.5, 0.25, 1.0], "rms_lateral_error": [0.1, 0.05, 0.2], "return": [-2.0, -3.0, -1.0]}
    env_id = "lanekeep/LaneKeep-v0"
    made_up = {"scenario": "s", "title": "t", "policies": {"pd": row, "ppo-x": row}}
    monkeypatch.setattr(reference, "SCORES", {**FILE, "environments": {env_id: made_up}})
    page = reference.scores(env_id)
    assert "| policy | failed [%] | RMS lateral error [m] | return |" in page
    assert (
        "| [pd](../controllers/pd.md) | 50.0 (25.0 to 100.0) | 0.100 (0.050 to 0.200) | -2.0 (-3.0 to -1.0) |" in page
    )
    assert "| ppo-x | 50.0" in page and "t: scenario s of `lanekeep bench lanekeep-2026.1`" in page
    assert reference.scores("lanekeep/New-v0").startswith("Not measured: ")
