"""What a lost car does and remembers: the way round, what it hears and does not see, echoes that are no glass."""

from __future__ import annotations

import numpy as np
import pytest

from lanekeep_baselines.free_drive import FreeDrive, Motion
from lanekeep_baselines.free_space import Body, FreeSpace
from lanekeep_baselines.local_map import LocalMap
from lanekeep_baselines.scan_features import ScanReader
from lanekeep_baselines.wall_design import WallCar
from lanekeep_baselines.wall_estimator import WallFilter
from lanekeep_env.scenario.scan import SCANS
from lanekeep_env.sensing.ultrasonic import HALF_CONE

TIGHTEST, NOSE, SIDE = 1.1, 0.44, 0.175
DRIVE = FreeDrive(FreeSpace(Body(NOSE, 0.09, 0.1325), TIGHTEST), 0.045, 2.0, 2.0)


def choose(side: float, heading: float, heard: float = np.inf, wanted: float = 0.0, speed: float = 1.0) -> tuple:
    """Curvature, speed and way back that a lost car without a wall around it chooses."""
    one = np.ones(1)
    motion = Motion(speed * one, 0.0 * one, -TIGHTEST * one, TIGHTEST * one)
    far = np.full((1, 1), 1e3)
    view = np.full((1, len(DRIVE.bearing)), 4.0)
    lost = np.array([True])
    choice = DRIVE.choose(far, far, motion, wanted * one, side * one, heading * one, heard * one, view, 0.0 * one, lost)
    return choice.curvature[0], choice.speed[0], choice.back[0]


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("degrees", [115.0, 140.0, 170.0])
def test_a_car_that_goes_the_wrong_way_round_turns_back(side: float, degrees: float) -> None:
    """On the shorter way, which leads it to the leg's direction; where the way round is not known it goes on."""
    heading = -side * np.deg2rad(degrees)
    curvature, _, _ = choose(side, heading)
    assert side * curvature > 0.05
    assert abs(choose(0.0, heading)[0]) < 0.05 * TIGHTEST


def test_it_can_stop_before_what_it_hears() -> None:
    heard = np.linspace(0.1, 3.0, 30)
    speeds = np.array([choose(0.0, 0.0, way)[1] for way in heard])
    assert (speeds**2 / (2.0 * 2.0) < np.maximum(heard, 0.02)).all() and (np.diff(speeds) >= 0.0).all()
    assert speeds[-1] == choose(0.0, 0.0)[1] == 2.0
    _, speed, back = choose(0.0, 0.0, 0.05, speed=0.0)
    assert speed < 0.0 < back


def map_of(scan: str) -> tuple[LocalMap, int]:
    reader = ScanReader(SCANS[scan])
    return LocalMap(reader, NOSE, SIDE), len(reader.angles)


@pytest.mark.parametrize(("scan", "echo", "glass"), [("perfect", 0.4, 1), ("kinect", 0.4, 0), ("kinect", 0.9, 1)])
def test_what_is_heard_and_was_never_shown_may_be_glass(scan: str, echo: float, glass: int) -> None:
    """Nearer than the camera sees the present scan tells nothing: the map then knows what was shown before."""
    walls, beams = map_of(scan)
    at = {"distance_front": np.array([echo]), "distance_right": np.zeros(1), "distance_left": np.zeros(1)}
    none, zero = np.full((beams, 1), np.inf), np.zeros(1)
    _, ahead = walls.update(at, none, np.zeros((1, walls.memory)), True, zero, zero)
    assert np.isfinite(ahead).all()
    assert np.isfinite(walls.unseen(at, none)).sum() == glass


def test_a_wall_that_was_shown_and_is_too_near_for_the_camera_now_explains_its_echo() -> None:
    walls, beams = map_of("kinect")
    at = {"distance_front": np.array([0.6]), "distance_right": np.zeros(1), "distance_left": np.zeros(1)}
    zero, fresh = np.zeros(1), np.zeros((1, walls.memory))
    memory, ahead = walls.update(at, np.full((beams, 1), 0.6), fresh, True, zero, zero)
    assert np.isinf(ahead).all()
    at["distance_front"] = np.array([0.4])
    _, ahead = walls.update(at, np.full((beams, 1), np.inf), memory, False, zero + 0.2, zero)
    assert np.isinf(ahead).all()


def test_a_box_that_reaches_into_the_cone_from_beside_explains_its_echo() -> None:
    """Its corner, 0.4 m ahead and 0.2 m to the left of the nose, is out of the cone, its front goes on into it."""
    walls, beams = map_of("kinect")
    angles = walls._reader.angles
    corner = np.arctan2(0.2, 0.7)
    ranges = np.where(np.abs(angles - corner) < 0.02, np.hypot(0.2, 0.7), np.inf)
    at = {"distance_front": np.array([0.7]), "distance_right": np.zeros(1), "distance_left": np.zeros(1)}
    zero, fresh = np.zeros(1), np.zeros((1, walls.memory))
    memory, _ = walls.update(at, ranges, fresh, True, zero, zero)
    at["distance_front"] = np.array([0.43])
    _, ahead = walls.update(at, np.full((beams, 1), np.inf), memory, False, zero + 0.3, zero)
    assert np.isinf(ahead).all()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("heading", [-0.3, 0.0, 0.2, 0.5, 0.8])
def test_a_wall_goes_on_between_the_cone_and_the_rim_that_shows_it(sign: float, heading: float) -> None:
    """A straight wall 0.8 m beside the side sensor: points on its line, none where the camera looks."""
    walls = map_of("perfect")[0]
    angles = walls._reader.angles[:, 0]
    slope, nose = sign * angles + heading, 0.8 - (NOSE - SIDE) * np.sin(heading)
    ranges = np.where(slope > 0.05, nose / np.sin(np.maximum(slope, 0.05)), np.inf)[:, None]
    nearest = 0.8 / np.cos(np.clip(heading, -HALF_CONE, HALF_CONE) - heading)
    side, other = ("left", "right") if sign > 0.0 else ("right", "left")
    at = {f"distance_{side}": np.array([nearest]), f"distance_{other}": np.zeros(1)}
    empty = np.full((1, walls.memory), 1e3)

    def points(shown: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = (values[:, 0] for values in walls.points(at, shown, empty, np.array([sign * heading])))
        return x[x < 100.0], sign * y[x < 100.0]

    x, y = points(ranges)
    seen = np.isfinite(ranges).sum()
    off = np.sin(heading) * (x - SIDE) + np.cos(heading) * y - 0.8
    hidden = np.arctan2(y, x - NOSE) > angles[-1]
    between = (np.abs(off) < 1e-9) & hidden
    assert between.sum() >= 2 and (~hidden).sum() <= seen
    assert np.abs(off[hidden & (x > SIDE + 0.8 * np.sin(HALF_CONE) + 1e-6)]).max(initial=0.0) < 1e-9
    # Something across instead of the wall at the rim: nobody knows where the wall ends.
    x, y = points(np.where(slope > 0.05, 2.0, np.inf)[:, None] / np.maximum(np.cos(slope), 0.2)[:, None])
    off = np.sin(heading) * (x - SIDE) + np.cos(heading) * y - 0.8
    assert (np.abs(off) < 1e-9).sum() <= 1


def test_nothing_is_unseen_where_the_whole_cone_shows_something() -> None:
    walls, beams = map_of("perfect")
    at = {"distance_front": np.full(2, 0.6)}
    ranges = np.full((beams, 2), 2.0)
    ranges[beams // 2 : beams // 2 + 8, 1] = np.inf
    np.testing.assert_array_equal(walls.unseen(at, ranges), [np.inf, 0.6])


@pytest.mark.parametrize("side", ["right", "left"])
def test_an_echo_beside_stands_for_a_corner_at_the_cones_rim_ahead(side: str) -> None:
    walls, beams = map_of("perfect")
    zero, none = np.zeros(1), np.full((beams, 1), np.inf)
    at = {"distance_right": zero, "distance_left": zero} | {f"distance_{side}": np.array([0.5])}
    memory, _ = walls.update(at, none, np.zeros((1, walls.memory)), True, zero, zero)
    x, y = walls.points(at, none, memory, zero)
    sign = -1.0 if side == "right" else 1.0
    rim = np.hypot(x - SIDE - 0.5 * np.sin(HALF_CONE), y - sign * 0.5 * np.cos(HALF_CONE))
    assert rim.min() < 1e-9


def test_a_measured_offset_corrects_all_states_as_kalman_has_it() -> None:
    rng = np.random.default_rng(3)
    estimator, rows = WallFilter(WallCar()), 50
    root = rng.normal(size=(rows, 4, 4))
    covariance, states = root @ np.swapaxes(root, 1, 2), rng.normal(size=(rows, 4))
    measured, noise, look = rng.normal(size=rows), 0.3, np.array([[0.0, 0.0, 1.0, 0.0]])
    memory = np.concatenate([states, covariance.reshape(rows, 16)], axis=1)
    corrected = estimator.correct_offset(memory, measured, noise)
    for k in range(rows):  # in information form
        information = np.linalg.inv(covariance[k]) + look.T @ look / noise**2
        after = np.linalg.inv(information)
        mean = after @ (np.linalg.inv(covariance[k]) @ states[k] + look[0] * measured[k] / noise**2)
        np.testing.assert_allclose(corrected[k, :4], mean, rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(corrected[k, 4:].reshape(4, 4), after, rtol=1e-5, atol=1e-7)
