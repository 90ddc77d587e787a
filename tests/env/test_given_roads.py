"""Roads from memory: points and clothoids."""

import json

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_env.roads import Road, road_from

TRUTH = Road("truth", [60.0, 80.0, 60.0], [0, 0, 0.01], [0, 0.01, 0.01])


def test_points_from_memory():
    points = TRUTH.position(np.arange(0.0, 200.1, 4.0))
    for given in (points, points.tolist(), {"kind": "points", "points": points.tolist(), "closed": False}):
        record = road_from(given)
        (road,) = record.build()
        assert road.length == pytest.approx(200.0, abs=1e-4) and not road.closed
        assert road_from(json.loads(json.dumps(record.to_dict()))) == record
    env = gym.make("lanekeep/LaneKeep-v0", road=points.tolist(), episode_steps="lap")
    env.reset(seed=0)
    assert np.isfinite(env.step(np.zeros(1))[0]).all()
    for bad in (np.zeros((3, 3)), [[1, 2], [3]], [["a", "b"]], np.full((9, 2), np.nan), [1, 2]):
        with pytest.raises(ValueError, match=r"road.points .* is not allowed: it must be 1 to"):
            road_from(bad)
    with pytest.raises(ValueError) as caught:
        road_from(np.ones((100_000, 3)))
    assert "of shape (100000, 3)" in str(caught.value) and len(str(caught.value)) < 200


def test_a_table_of_pandas_is_named_not_printed():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(TRUTH.position(np.arange(0.0, 200.1, 4.0)), columns=["x", "y"])
    with pytest.raises(ValueError, match=r"^road=<DataFrame of shape \(51, 2\)> must be .*to_numpy.*path$"):
        road_from(table)
    assert road_from(table[["x", "y"]].to_numpy()).build()[0].length == pytest.approx(200.0, abs=1e-4)


def test_clothoids_from_memory():
    rows = np.column_stack([TRUTH.lengths, TRUTH.curvature_start, TRUTH.curvature_end])
    (road,) = road_from({"kind": "clothoids", "segments": rows}).build()
    assert np.array_equal(road.curvature_end, TRUTH.curvature_end) and road.length == 200.0
    with pytest.raises(ValueError, match="needs 'segments'"):
        road_from("clothoids")
    with pytest.raises(ValueError, match="length"):
        road_from({"kind": "clothoids", "segments": [[-1.0, 0.0, 0.0]]})
