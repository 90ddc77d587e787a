"""Wall, obstacle or nothing in scans whose truth is known, and the wall's angle."""

from __future__ import annotations

import numpy as np
import pytest
from scan_oracle import VIEW, box, cast, wall

from lanekeep_baselines.scan_classes import IMPROVED, NOTHING, OBSTACLE, PUBLISHED, WALL, Perception, Seen, classify
from lanekeep_baselines.scan_points import points
from lanekeep_env.scenario import Scan

CAMERA = Scan(beams=141)
BOTH = pytest.mark.parametrize("rule", [PUBLISHED, IMPROVED], ids=["published", "improved"])


def look(raw: np.ndarray, rule: Perception) -> Seen:
    return classify(rule.points(raw, CAMERA), CAMERA, rule)


@BOTH
@pytest.mark.parametrize("angle", [15.0, 25.0, 40.0, 60.0, 75.0, -15.0, -30.0, -70.0, 90.0])
def test_a_wall_s_angle_to_half_a_degree(rule, angle):
    seen = look(cast(wall(0.85, np.deg2rad(angle))), rule)
    assert seen.kind == WALL
    assert np.abs(np.sin(seen.angle - np.deg2rad(angle))) < np.deg2rad(0.5)


@BOTH
def test_a_wall_at_a_small_angle_is_the_controller_s(rule):
    for angle, kind in ((8.0, NOTHING), (-8.0, NOTHING), (12.0, WALL), (-12.0, WALL)):
        assert look(cast(wall(1.6, np.deg2rad(angle))), rule).kind == kind


@BOTH
@pytest.mark.parametrize("turned", [0.0, 0.4, np.pi / 4])
@pytest.mark.parametrize("left", [-0.1, 0.0, 0.15])
def test_a_box_ahead_is_an_obstacle(rule, left, turned):
    raw = cast(box(1.0, left, 0.3, 0.3, turned), wall(4.0, np.pi / 2), [(0.0, -1.0), (4.0, -1.0)])
    assert look(raw, rule).kind == OBSTACLE


@BOTH
def test_nothing_in_the_box_is_nothing(rule):
    far, beside = wall(2.0, np.pi / 2), [(0.0, -0.6), (2.0, -0.6)]
    for raw in (cast(far, beside), cast(box(0.9, 0.6, 0.3, 0.3), far), np.zeros((1, 141))):
        seen = look(raw, rule)
        assert (seen.kind == NOTHING) and (seen.angle == 0.0) and (seen.hit == -1)


@BOTH
@pytest.mark.parametrize("length, kind", [(0.45, OBSTACLE), (0.55, WALL)])
def test_a_wall_is_at_least_half_a_metre_long_to_either_side(rule, length, kind):
    """Slanted, so that its ends are in view; the hit is where it crosses the box's edge or the nearest point in it."""
    angle = np.deg2rad(30.0)
    raw = cast(wall(0.9, angle, right=3.0, left=length), wall(5.0, np.pi / 2))
    start = look(raw, rule).hit
    place = points(raw, -0.5 * VIEW, CAMERA.step)[0, start[0]]
    beyond = length - (place[0] - 0.9) * np.cos(angle) - place[1] * np.sin(angle)
    assert look(raw, rule).kind == (WALL if beyond > 0.5 else OBSTACLE)
    moved = length + (0.5 - beyond) + (0.05 if kind == WALL else -0.05)
    assert look(cast(wall(0.9, angle, right=3.0, left=moved), wall(5.0, np.pi / 2)), rule).kind == kind


def test_what_the_published_reading_misses():
    """A slim box that the median erases, and one behind a wall that is the controller's."""
    slim = cast(box(0.9, 0.0, 0.1, 0.1), wall(4.0, np.pi / 2))
    assert look(slim, PUBLISHED).kind == NOTHING and look(slim, IMPROVED).kind == OBSTACLE
    masked = cast(wall(2.0, np.deg2rad(6.0), right=2.0, left=0.0), box(1.0, 0.15, 0.2, 0.3), wall(5.0, np.pi / 2))
    assert look(masked, PUBLISHED).kind == NOTHING and look(masked, IMPROVED).kind == OBSTACLE


def test_a_wall_too_near_to_be_seen_at_one_side_goes_on_there():
    raw = cast(wall(0.62, np.deg2rad(50.0)), wall(4.0, np.pi / 2))
    raw[raw < CAMERA.nearest] = 0.0
    assert raw[0, 0] == 0.0
    raw[:, -6:] = 0.0  # lost at the rim
    seen = look(raw, IMPROVED)
    assert seen.kind == WALL and seen.angle == pytest.approx(np.deg2rad(50.0), abs=np.deg2rad(0.5))
    assert look(raw, PUBLISHED).kind == OBSTACLE


def test_least_squares_bear_noise_better_than_the_ends():
    random, errors = np.random.default_rng(1), {}
    true = np.deg2rad(50.0)
    clean = cast(wall(0.85, true)).repeat(300, axis=0)
    raw = clean + 0.01 * clean**2 * random.standard_normal(clean.shape)
    for rule in (PUBLISHED, IMPROVED):
        seen = look(raw, Perception(window=5, fitted=rule.fitted))
        errors[rule] = np.sqrt(np.mean((seen.angle[seen.kind == WALL] - true) ** 2))
        assert (seen.kind == WALL).mean() > 0.9
    assert errors[IMPROVED] < 0.6 * errors[PUBLISHED]


@BOTH
def test_rows_are_independent_to_the_last_bit(rule):
    raw = np.random.default_rng(2).uniform(0.0, 3.0, (40, 1)) + np.random.default_rng(3).uniform(0.0, 0.2, (40, 141))
    together = look(raw, rule)
    assert len(set(together.kind)) > 1
    for row in range(40):
        for one, all_rows in zip(look(raw[row : row + 1], rule), together, strict=True):
            np.testing.assert_array_equal(one[0], all_rows[row])
