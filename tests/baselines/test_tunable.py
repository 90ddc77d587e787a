"""Tuned controllers: other values of what is declared, their files, their margins."""

import pickle

import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.lq import LinearQuadraticGaussian, LqPreviewOffsetFree
from lanekeep_baselines.lq_design import Weights
from lanekeep_baselines.margins import margins
from lanekeep_baselines.tunable import tuned_text
from lanekeep_env.scenario import LaneKeepScenario

GOOD = {"lateral_gain": 0.03, "heading_gain": 0.5}


def test_a_tuned_policy_comes_back_from_a_pickle():
    policy = lanekeep_baselines.make("stanley", LaneKeepScenario(), gain=2.7)
    again = pickle.loads(pickle.dumps(policy))
    observation = np.full((3, len(LaneKeepScenario().channels)), 0.1, dtype=np.float32)
    assert again.gain == 2.7
    assert np.array_equal(again.predict(observation)[0], policy.predict(observation)[0])


@pytest.mark.parametrize("policy", [LqPreviewOffsetFree, LinearQuadraticGaussian])
def test_tuned_weights_keep_their_margins(policy):
    """Weights that as they are have an Ms above 2 are moved as the shipped ones are."""
    values = {"rate": 0.2, "slip": 1e-3, "drift": 2e-2, "bend": 1.0, "lag": 0.0}
    scenario = LaneKeepScenario(preview=20)
    bare = policy(scenario, Weights(**values, steer=policy.weights.steer))
    tuned = lanekeep_baselines.make(policy.name, scenario, **values)
    speeds = (10.0, 20.0, 40.0)
    assert max(margins(bare, scenario, speed).sensitivity for speed in speeds) > 2.0
    assert max(margins(tuned, scenario, speed).sensitivity for speed in speeds) <= 2.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "best.json"),
        ("[]", "format=None is not allowed"),
        ('{"format": "lanekeep-tuned-2"}', "format='lanekeep-tuned-2' is not allowed"),
        (tuned_text({}, policy_file="trial-2/ppo.json"), "the policy is trial-2/ppo.json beside it"),
        (tuned_text({}, policy="pd"), "must be a name and numbers"),
        (tuned_text({**GOOD, "heading_gain": "1"}, policy="pd"), "must be a finite number"),
        (tuned_text({**GOOD, "heading_gain": True}, policy="pd"), "must be a finite number"),
        (tuned_text({**GOOD, "heading_gain": float("nan")}, policy="pd"), "NaN"),
        (tuned_text({**GOOD, "heading_gain": 100.0}, policy="pd"), "heading_gain=100.0 is not allowed"),
        (tuned_text({"predict": 1.0}, policy="pd"), "has no tunable number 'predict'"),
        (tuned_text({"scenario": 1.0}, policy="pd"), "has no tunable number 'scenario'"),
        (tuned_text(GOOD, policy="pdd"), "did you mean 'pd'"),
        (tuned_text(GOOD, policy="yin-lqr"), "has no tunable number 'lateral_gain'"),
        ('{"format": "lanekeep-tuned-1", "x": ' + "[" * 100 + "]" * 100 + "}", "nested"),
    ],
)
def test_files_that_hold_no_tuned_values_are_refused(tmp_path, text, says):
    file = tmp_path / "best.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=says) as error:
        lanekeep_baselines.load(file, LaneKeepScenario())
    assert str(file) in str(error.value) and "\n" not in str(error.value)
