"""Perception of random scenes: their truth is what geometry says, and the improved reading is clearly better."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from lanekeep_baselines.scan_classes import IMPROVED, NOTHING, OBSTACLE, PUBLISHED, WALL
from lanekeep_benchmarks.replications import knightriders_scenes as scenery
from lanekeep_benchmarks.replications.knightriders_perception import confusion, judged, share_right

COUNT = 300


@pytest.fixture(scope="module")
def scenes():
    return scenery.draw(COUNT, 7)


def test_scenes_repeat_and_are_of_all_kinds(scenes):
    again = scenery.draw(COUNT, 7)
    np.testing.assert_array_equal(again.ranges, scenes.ranges)
    np.testing.assert_array_equal(again.heard, scenes.heard)
    assert set(scenes.case) == set(range(len(scenery.CASES)))
    assert (np.bincount(scenes.truth) > COUNT / 4).all()


def test_the_truth_is_the_geometry_of_what_is_in_the_box():
    """Walls and boxes that are in the way reach into the smaller of both boxes; what is not in the way, in neither."""
    random = np.random.default_rng(8)
    both = shapely.box(0.0, -scenery.WAY, 1.0, scenery.WAY)
    either = shapely.box(0.0, -0.25, 1.2, 0.25)
    for make, truth in ((scenery._wall, WALL), (scenery._obstacle, OBSTACLE), (scenery._nothing, NOTHING)):
        for _ in range(100):
            case, solid, glass = make(random)
            shapes = shapely.union_all([shapely.LineString(part.reshape(2, 2)) for part in (*solid, *glass)])
            if truth != NOTHING:
                assert shapes.intersects(both), scenery.CASES[case]
            elif scenery.CASES[case] != "slanted under 8°":
                assert not shapes.intersects(either), scenery.CASES[case]
            if truth == WALL:
                ends = [part[2:] - part[:2] for part in (*solid, *glass)]
                assert all(abs(y) > np.tan(np.deg2rad(12.0)) * abs(x) for x, y in ends)


def test_the_improved_reading_is_clearly_better(scenes):
    wrong = {}
    for rule in (PUBLISHED, IMPROVED):
        kind = judged(scenes, rule).kind
        table = confusion(scenes.truth, kind)
        assert table.sum() == COUNT and (table.sum(axis=1) == np.bincount(scenes.truth)).all()
        wrong[rule] = 100.0 - share_right(scenes, kind)
        assert np.trace(table) == round(COUNT * (100.0 - wrong[rule]) / 100.0)
    assert wrong[IMPROVED] < 5.0 and wrong[IMPROVED] < 0.25 * wrong[PUBLISHED]
    # An obstacle that is not seen is a contact: none.
    kind = judged(scenes, IMPROVED).kind
    assert (kind[scenes.truth == OBSTACLE] != NOTHING).all()


def test_glass_is_found_with_the_ultrasonic_only(scenes):
    glass = (scenes.case == scenery.CASES.index("glass")) & (scenes.truth == WALL)
    assert (judged(scenes, PUBLISHED).kind[glass] != WALL).all()
    found = (judged(scenes, IMPROVED).kind[glass] == WALL).mean()
    assert found > 0.6
    # Deaf, the improved reading misses it as well.
    deaf = scenery.Scenes(scenes.ranges, np.zeros(COUNT), scenes.beside, scenes.truth, scenes.case)
    assert (judged(deaf, IMPROVED).kind[glass] == WALL).mean() < 0.1
