"""Planned paths against an integrated car, geometry and the numbers recomputed from the report by others."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lanekeep_baselines import path_planning as planning

#: Rear axle's radius at 22 degrees of steering of the report's car, and of the PSES platform, m.
R22, PSES = 0.35 / np.tan(np.deg2rad(22.0)), 0.93
TARGETS = 10_000


def integrated(segments: np.ndarray) -> np.ndarray:
    """The end pose of a rolling car, x' = cos(heading), y' = sin(heading), heading' = curvature, per metre."""
    rows = len(segments)
    pose = np.zeros(3 * rows)
    for way, curvature in (segments[:, k].T for k in range(segments.shape[1])):

        def rolls(_, state, way=way, curvature=curvature):
            heading = state[2 * rows :]
            return np.concatenate([way * np.cos(heading), way * np.sin(heading), way * curvature])

        pose = solve_ivp(rolls, (0.0, 1.0), pose, method="DOP853", rtol=1e-9, atol=1e-9).y[:, -1]
    return pose.reshape(3, rows).T


def targets(seed: int) -> tuple[np.ndarray, ...]:
    """Targets (m) on both sides, before and beside the car, and different radii (m)."""
    random = np.random.default_rng(seed)
    ahead, left = random.uniform(-0.5, 3.0, TARGETS), random.uniform(-2.5, 2.5, TARGETS)
    return ahead, left, random.uniform(0.4, 1.5, TARGETS), random.uniform(0.4, 1.5, TARGETS)


def off(turn: np.ndarray) -> np.ndarray:
    return np.abs(np.angle(np.exp(1j * turn)))


@pytest.mark.parametrize("arcs", [2, 1])
def test_ten_thousand_targets_are_reached_or_have_no_path(arcs):
    ahead, left, to_left, to_right = targets(arcs)
    planner = planning.s_curve if arcs == 2 else planning.arc_and_straight
    segments, ok = planner(ahead, left, to_left, to_right)
    assert np.isfinite(segments).all()
    pose = integrated(segments)
    assert np.abs(pose[ok, 0] - ahead[ok]).max() < 1e-4
    assert np.abs(pose[ok, 1] - left[ok]).max() < 1e-4
    if arcs == 2:
        assert off(pose[ok, 2]).max() < 1e-6
    radius = to_left + to_right if arcs == 2 else np.where(left > 0.0, to_left, to_right)
    inside = np.hypot(ahead, np.abs(left) - radius) < radius
    edge = np.abs(np.hypot(ahead, np.abs(left) - radius) - radius) < 1e-9
    assert (ok == ~inside)[~edge].all()
    assert 0.1 < ok.mean() < 0.95  # both answers occur
    # From inside the circle no tangent of it passes through the target: its distance to all of them is positive.
    turn = np.linspace(0.0, 2.0 * np.pi, 721)
    distance = radius[~ok, None] - (ahead[~ok, None] * np.sin(turn) + (radius - np.abs(left))[~ok, None] * np.cos(turn))
    assert distance.min() > 0.0
    # Arcs and straights are driven forwards, arcs on the two radii.
    assert (segments[..., 0] >= 0.0).all()
    first = np.where(left > 0.0, 1.0 / to_left, -1.0 / to_right)
    np.testing.assert_allclose(segments[ok, 0, 1], first[ok])
    assert (segments[:, 1, 1] == 0.0).all()


def test_ten_thousand_parking_manoeuvres_end_along_the_kerb():
    random = np.random.default_rng(3)
    shift, right, left = random.uniform(0.0, 2.0, TARGETS), *random.uniform(0.4, 1.5, (2, TARGETS))
    segments, travel, ok = planning.parallel_parking(shift, right, left)
    assert ok.all() and np.isfinite(segments).all() and (segments[..., 0] <= 0.0).all()
    pose = integrated(segments)
    np.testing.assert_allclose(pose[:, 0], -travel, atol=1e-4)
    np.testing.assert_allclose(pose[:, 1], -shift, atol=1e-4)
    assert off(pose[:, 2]).max() < 1e-6
    whole = shift >= (right + left) * (1.0 - np.sqrt(0.5))
    turned = np.abs(segments[:, 0, 0] * segments[:, 0, 1])
    np.testing.assert_allclose(turned[whole], np.pi / 4.0)
    assert (turned[~whole] < np.pi / 4.0).all() and (segments[~whole, 1, 0] == 0.0).all()
    assert 0.1 < whole.mean() < 0.9


def test_closed_form_drive_is_the_integrated_car():
    random = np.random.default_rng(4)
    segments = random.uniform(-2.0, 2.0, (500, 4, 2))
    segments[::7, 1, 1] = 0.0
    pose = planning.drive(segments, np.zeros((500, 3)))
    np.testing.assert_allclose(pose, integrated(segments), atol=1e-6)
    start = random.uniform(-3.0, 3.0, (500, 3))
    cosine, sine = np.cos(start[:, 2]), np.sin(start[:, 2])
    x, y = cosine * pose[:, 0] - sine * pose[:, 1], sine * pose[:, 0] + cosine * pose[:, 1]
    moved = np.stack([start[:, 0] + x, start[:, 1] + y, start[:, 2] + pose[:, 2]], axis=1)
    np.testing.assert_allclose(planning.drive(segments, start), moved, atol=1e-12)


@pytest.mark.parametrize(
    "radius, shifts, both, alone",
    [
        (R22, [0.2, 0.35, 0.5, 0.7], [0.808, 1.044, 1.218, 1.391], [0.554, 0.696, 0.785]),
        (PSES, [0.2, 0.35, 0.5, 0.7], [0.839, 1.086, 1.269, 1.454], [0.576, 0.727, 0.825]),
    ],
)
def test_the_shortest_way_ahead(radius, shifts, both, alone):
    shortest = planning.shortest_ahead(shifts, 2.0 * radius)
    np.testing.assert_allclose(shortest, both, atol=6e-4)
    np.testing.assert_allclose(planning.shortest_ahead(shifts[:3], radius), alone, atol=6e-4)
    for factor, possible in ((1.0 + 1e-9, True), (1.0 - 1e-9, False)):
        assert (planning.s_curve(factor * shortest, shifts, radius, radius).ok == possible).all()
        ahead = factor * planning.shortest_ahead(shifts, radius)
        assert (planning.arc_and_straight(ahead, shifts, radius, radius).ok == possible).all()


@pytest.mark.parametrize(
    "radius, angles, travels, total, travel",
    [
        (R22, [34.2, 39.7, 44.7], [0.974, 1.107, 1.218], 0.507, 1.225),
        (PSES, [33.0, 38.3, 43.0], [1.013, 1.152, 1.269], 0.545, 1.315),
    ],
)
def test_the_numbers_of_parking(radius, angles, travels, total, travel):
    segments, back, ok = planning.parallel_parking([0.3, 0.4, 0.5], radius, radius)
    assert ok.all()
    np.testing.assert_allclose(np.rad2deg(-segments[:, 0, 0] / radius), angles, atol=0.06)
    np.testing.assert_allclose(back, travels, atol=6e-4)
    # From there on arcs are 45 degrees.
    shift = 2.0 * radius * (1.0 - np.sqrt(0.5))
    assert abs(shift - total) < 6e-4
    longer = planning.parallel_parking([shift, shift + 0.1], radius, radius)
    np.testing.assert_allclose(-longer.segments[:, [0, 2], 0], radius * np.pi / 4.0, rtol=1e-6)
    np.testing.assert_allclose(longer.segments[:, 1, 0], [0.0, -0.1 * np.sqrt(2.0)], atol=1e-6)
    np.testing.assert_allclose(longer.travel, [travel, travel + 0.1], atol=6e-4)


def test_the_shortest_gap():
    assert planning.shortest_gap(0.09, 0.44, 0.265, PSES) == pytest.approx(0.8745, abs=5e-5)
    assert planning.shortest_gap(0.091, 0.532, 0.265, R22) == pytest.approx(0.8995, abs=5e-5)


@pytest.mark.parametrize("radius, overhang, length", [(R22, 0.091, 0.532), (PSES, 0.09, 0.44)])
def test_the_shortest_gap_is_what_the_body_sweeps(radius, overhang, length):
    """Driven out of the gap: the body's outer front corner passes the car in front at the gap's end, and just so."""
    width, gap = 0.265, planning.shortest_gap(overhang, length, 0.265, radius)
    turn = np.linspace(0.0, np.pi / 4.0, 20_001)
    pose = planning.roll(np.zeros(3), turn * radius, 1.0 / radius)
    ahead, right = length - overhang, 0.5 * width
    x = pose[:, 0] + ahead * np.cos(pose[:, 2]) + right * np.sin(pose[:, 2])
    y = pose[:, 1] + ahead * np.sin(pose[:, 2]) - right * np.cos(pose[:, 2])
    inside = y <= right  # of the row of parked cars, which are as wide and as near to the kerb
    assert (overhang + x[inside]).max() == pytest.approx(gap, abs=2e-3)


def test_the_report_s_order_of_paths():
    shift = 0.35
    reaches = planning.shortest_ahead(shift, np.array([2.0 * R22, R22]))
    ahead = np.array([reaches[0] + 0.1, reaches[1] + 0.1, reaches[1] - 0.1, -1.0])
    segments = planning.evade(ahead, shift, R22, R22, 0.3)
    np.testing.assert_array_equal((segments[..., 0] != 0.0).sum(axis=1), [3, 2, 1, 1])
    np.testing.assert_array_equal(segments[2:, 0], [[-0.3, 0.0]] * 2)
    end = planning.drive(segments, np.zeros((4, 3)))
    np.testing.assert_allclose(end[:2, :2], np.stack([ahead[:2], [shift, shift]], axis=1), atol=1e-9)
    assert planning.from_rear_axle(0.5, 0.35, 0.091) == pytest.approx(0.941)


def test_nothing_is_nan_whatever_is_asked():
    odd = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-320, 1e300, -1e300, 1.0, -1.0, 1e6, 1e-3])
    ahead, left, to_left, to_right = (grid.ravel() for grid in np.meshgrid(odd, odd, odd, odd))
    with np.errstate(all="raise", under="ignore"):
        plans = [
            planning.s_curve(ahead, left, to_left, to_right),
            planning.arc_and_straight(ahead, left, to_left, to_right),
            planning.parallel_parking(ahead, to_left, to_right),
        ]
        evading = planning.evade(ahead, left, to_left, to_right, ahead)
        ends = [planning.drive(plan.segments, np.zeros((len(ahead), 3))) for plan in plans]
    assert np.isfinite(evading).all()
    for plan, end in zip(plans, ends, strict=True):
        assert np.isfinite(plan.segments).all() and np.isfinite(end).all()
        assert (plan.segments[~plan.ok] == 0.0).all() and plan.ok.any()
        usable = (to_left >= 1e-3) & (to_left <= 1e6) & (to_right >= 1e-3) & (to_right <= 1e6)
        assert not plan.ok[~usable & ((plan is not plans[1]) | (to_left == to_right))].any()
    assert np.isfinite(plans[2].travel).all()


def test_rows_are_independent_to_the_last_bit():
    ahead, left, to_left, to_right = (values[:100] for values in targets(5))
    together = planning.evade(ahead, left, to_left, to_right, 0.3), planning.parallel_parking(ahead, to_left, to_right)
    for row in range(100):
        one = slice(row, row + 1)
        alone = planning.evade(ahead[one], left[one], to_left[one], to_right[one], 0.3)
        np.testing.assert_array_equal(alone, together[0][one])
        parked = planning.parallel_parking(ahead[one], to_left[one], to_right[one])
        np.testing.assert_array_equal(parked.segments, together[1].segments[one])
