"""Jump points, free space, the corner rule, glass and the body's clearance, where geometry tells the truth."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from scan_oracle import VIEW, box, cast, wall

from lanekeep_baselines import path_planning as planning
from lanekeep_baselines import scan_glass as glass
from lanekeep_baselines.path_clearance import Body, aside, clearance
from lanekeep_baselines.scan_classes import IMPROVED, NOTHING, PUBLISHED, WALL, Perception, classify
from lanekeep_baselines.scan_corners import right_corner
from lanekeep_baselines.scan_targets import ASIDE, jump_point
from lanekeep_env.scenario import Scan

CAMERA = Scan(beams=141)
STEP = CAMERA.step
BOTH = pytest.mark.parametrize("rule", [PUBLISHED, IMPROVED], ids=["published", "improved"])
#: The report's car at 22 degrees, nose 0.441 m ahead of the rear axle.
CAR = Body(0.441, 0.091, 0.1325, 0.35 / np.tan(np.deg2rad(22.0)), 0.35 / np.tan(np.deg2rad(22.0)))


def seen_points(raw: np.ndarray, rule: Perception) -> np.ndarray:
    return rule.points(raw, CAMERA)


@BOTH
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_jump_point_is_the_free_edge_to_the_beams_resolution(rule, side):
    """A box with a wall close beside one edge and space beside the other."""
    blocked = [(1.0, side * -0.4), (3.0, side * -0.4)]
    raw = cast(box(1.15, 0.0, 0.3, 0.4), blocked, wall(4.0, np.pi / 2))
    found = jump_point(seen_points(raw, rule), CAMERA, rule)
    assert found.found and found.side == side
    # At the edge at (1, 0.2) beams are STEP * 1.02 m apart, across 2 % more.
    assert found.ahead == pytest.approx(1.0, abs=1e-6) and 0.0 <= 0.2 - side * found.left[0] <= STEP * 1.05
    ahead, left = found.target(ASIDE)
    assert ahead == found.ahead and side * left == pytest.approx(side * found.left + 0.2)


@BOTH
def test_too_narrow_on_both_sides_is_none_and_the_longer_rim_is_told(rule):
    raw = cast(box(1.15, 0.0, 0.3, 0.4), [(0.5, 0.5), (4.0, 0.5)], [(0.5, -0.6), (4.0, -0.6)], wall(4.0, np.pi / 2))
    found = jump_point(seen_points(raw, rule), CAMERA, rule)
    assert not found.found and found.side == -1.0 and found.ahead == 0.0


def test_jump_points_farther_than_one_and_a_half_metres_do_not_count():
    for near, is_found in ((1.4, True), (1.6, False)):
        raw = cast(box(near + 0.1, 0.0, 0.2, 0.4), wall(5.0, np.pi / 2))
        assert jump_point(seen_points(raw, PUBLISHED), CAMERA, PUBLISHED).found == is_found


def test_the_nearest_free_jump_point_is_taken():
    near, far = box(1.0, 0.3, 0.2, 0.2), box(1.3, -0.3, 0.2, 0.3)
    found = jump_point(seen_points(cast(near, far, wall(5.0, np.pi / 2)), IMPROVED), CAMERA, IMPROVED)
    assert found.found and found.ahead == pytest.approx(0.9, abs=1e-6)
    assert found.side == 1.0 and found.left == pytest.approx(0.4, abs=STEP)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_one_wrong_beam_beside_a_jump_moves_the_improved_point_by_one_beam_at_most(share):
    """Depth cameras show something between both sides there; the filter may take that beam's place for the edge's."""
    raw = cast(box(1.15, 0.0, 0.3, 0.4), wall(4.0, np.pi / 2))
    true = jump_point(IMPROVED.points(raw, CAMERA), CAMERA, IMPROVED)
    for edge, towards in ((np.flatnonzero(raw[0] < 1.1)[-1], 1), (np.flatnonzero(raw[0] < 1.1)[0], -1)):
        for beam in (edge, edge + towards):
            mixed = raw.copy()
            mixed[0, beam] = (1.0 - share) * raw[0, edge] + share * raw[0, edge + towards]
            found = jump_point(IMPROVED.points(mixed, CAMERA), CAMERA, IMPROVED)
            assert found.found and found.ahead == pytest.approx(true.ahead, abs=0.02)
            assert abs(found.left - found.side * np.abs(true.left)) <= 1.1 * STEP


@BOTH
@pytest.mark.parametrize("ends", [1.5, 1.9, 2.3])
def test_a_corner_s_place(rule, ends):
    raw = cast([(0.0, -0.5), (ends, -0.5)], [(ends, -0.5), (ends, -5.0)], wall(ends + 2.0, np.pi / 2))
    corner = right_corner(seen_points(raw, rule), CAMERA, rule)
    assert corner.found and corner.left == pytest.approx(-0.5, abs=1e-6)
    # Beams are y² STEP / 0.5 m apart along the wall.
    assert 0.0 <= ends - corner.ahead[0] <= 1.3 * ends**2 * STEP / 0.5


@BOTH
def test_what_is_no_corner(rule):
    beside, ahead = -0.5, wall(5.0, np.pi / 2)
    start = 0.5 / np.tan(0.5 * VIEW)  # where the rim's beam meets the wall
    scenes = {
        "short": [[(0.0, beside), (start + 0.7, beside)]],
        "long": [[(0.0, beside), (start + 2.3, beside)]],
        "no end": [[(0.0, beside), (5.0, beside)]],
        "slanted": [[(0.0, -0.9), (1.7, -0.1)]],
        "far": [[(0.0, -1.6), (4.0, -1.6)]],
        "no space": [[(0.0, beside), (1.7, beside)], [(2.05, -1.0), (2.05, 0.0)]],
    }
    for name, walls in scenes.items():
        assert not right_corner(seen_points(cast(*walls, ahead), rule), CAMERA, rule).found, name


def test_glass_is_heard_and_not_seen():
    angles = np.linspace(-0.5 * VIEW, 0.5 * VIEW, 141)
    cone = np.deg2rad(22.5)
    raw = cast(wall(3.0, np.pi / 2), [(0.0, -0.5), (4.0, -0.5)])
    shown = glass.shown_ahead(raw, angles, cone)
    assert shown == pytest.approx(0.5 / np.sin(cone), rel=0.03)  # the side wall
    heard = np.array([0.9, shown[0] - 0.05, 0.0, np.nan])
    found = glass.is_glass(heard, shown)
    np.testing.assert_array_equal(found, [True, False, False, False])
    seen = classify(seen_points(raw, IMPROVED), CAMERA, IMPROVED)
    assert seen.kind == NOTHING
    assert glass.with_glass(seen, found[:1], heard[:1], IMPROVED).kind == WALL
    assert glass.with_glass(seen, found[1:2], heard[1:2], IMPROVED).kind == NOTHING
    assert glass.shown_beside(raw, angles, -1.0) == pytest.approx(0.5)
    assert glass.is_glass(0.5, glass.shown_beside(raw, angles, 1.0)) and np.isinf(glass.shown_ahead(0 * raw, angles, 1))
    assert not glass.is_glass(0.5, glass.shown_beside(raw, angles, -1.0))
    # A glass wall beside the car is heard ahead where the cone's rim meets it, and is none ahead.
    at_rim = shapely.LineString([(0.0, -0.4), (9.0, -0.4)]).intersection(
        shapely.LineString([(0.0, 0.0), (9.0 * np.cos(cone), -9.0 * np.sin(cone))])
    )
    echo = glass.echo_of_side(np.array([0.4, 0.0]), cone)
    assert echo[0] == pytest.approx(np.hypot(at_rim.x, at_rim.y)) and np.isinf(echo[1])


@BOTH
def test_rows_are_independent_to_the_last_bit(rule):
    raw = np.repeat(np.random.default_rng(6).uniform(0.6, 2.5, (60, 47)), 3, axis=1)
    raw[30:] = cast([(0.0, -0.5), (1.6, -0.5)], wall(4.0, np.pi / 2)) + 0.01 * raw[30:]
    place = rule.points(raw, CAMERA)
    for read in (jump_point, right_corner):
        together = read(place, CAMERA, rule)
        assert 0 < together.found.sum() < 60
        for row in range(60):
            for one, every in zip(read(place[row : row + 1], CAMERA, rule), together, strict=True):
                np.testing.assert_array_equal(one[0], every[row])


def test_clearance_is_shapely_s_distance_to_the_swept_body():
    random = np.random.default_rng(4)
    for _ in range(40):
        radii = random.uniform(0.6, 1.2, 2)
        segments = planning.evade(random.uniform(0.9, 1.6), random.uniform(-0.5, 0.5), *radii, 0.3)
        ahead, left = random.uniform(0.2, 1.6), random.uniform(-0.8, 0.8)
        pose, least = np.zeros(3), np.inf
        for way, bend in segments[0]:
            for place in planning.roll(pose, np.linspace(0.0, way, 25), bend):
                body = shapely.box(-CAR.rear, -CAR.half_width, CAR.front, CAR.half_width)
                body = shapely.affinity.rotate(body, place[2], origin=(0.0, 0.0), use_radians=True)
                body = shapely.affinity.translate(body, *place[:2])
                point = shapely.Point(ahead, left)
                inside = -body.exterior.distance(point) if body.contains(point) else body.distance(point)
                least = min(least, inside)
            pose = planning.roll(pose, way, bend)
        assert clearance(segments, ahead, left, CAR)[0] == pytest.approx(least, abs=1e-9)


def test_the_published_target_leaves_less_than_seven_centimetres_and_the_improved_one_its_margin():
    ahead, left, side = np.array([0.7, 0.9, 1.1, 0.9]), np.array([0.1, 0.1, 0.2, -0.1]), np.array([1.0, 1.0, 1.0, -1.0])
    from_axle = planning.from_rear_axle(ahead, 0.35, 0.091)
    paths = planning.evade(from_axle, left + side * ASIDE, CAR.radius_left, CAR.radius_right, 0.3)
    published = clearance(paths, from_axle, left, CAR)
    assert (published <= ASIDE - CAR.half_width + 1e-9).all() and ASIDE - CAR.half_width == pytest.approx(0.0675)
    offset = aside(ahead, left, side, CAR, 0.1, 0.3)
    assert (offset >= CAR.half_width + 0.1).all()
    paths = planning.evade(from_axle, left + side * offset, CAR.radius_left, CAR.radius_right, 0.3)
    assert (clearance(paths, from_axle, left, CAR) >= 0.1 - 1e-9).all()
