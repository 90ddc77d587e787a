"""The narrowest corridors round a right angle: numbers of the report's car, a swept rectangle, and who is refused."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest
import shapely
import shapely.affinity

import lanekeep_env  # noqa: F401
from lanekeep_env.walls.corners import swept_corner, turned_corner

CIRCUIT = "lanekeep/Circuit-v0"


def rectangle(length: float, width: float) -> shapely.Polygon:
    return shapely.box(-length / 2, -width / 2, length / 2, width / 2)


def walls(corridor: float) -> shapely.Geometry:
    """Outside of two corridors that meet at a right angle: inner corner at the origin, outer one up right."""
    free = shapely.union(shapely.box(-9.0, 0.0, corridor, corridor), shapely.box(0.0, -9.0, corridor, corridor))
    return shapely.box(-8.9, -8.9, 8.9, 8.9) - free


def test_the_source_s_car_needs_these_widths() -> None:
    assert swept_corner(0.532, 0.265, 0.35, math.radians(22.0)) == pytest.approx(0.573, abs=5e-4)
    assert turned_corner(0.532, 0.265) == pytest.approx(0.3755, abs=5e-4)


@pytest.mark.parametrize("seed", range(4))
def test_a_body_on_an_arc_fits_where_it_says_and_not_in_less(seed: int) -> None:
    random = np.random.default_rng(seed)
    wheelbase, angle = random.uniform(0.25, 0.45), random.uniform(0.3, 0.45)
    length, width = wheelbase + random.uniform(0.1, 0.3), random.uniform(0.15, 0.3)
    needed, radius = swept_corner(length, width, wheelbase, angle), wheelbase / math.tan(angle)
    inner = (radius - width / 2) / math.sqrt(2.0)
    bodies = []
    for turned in np.linspace(0.0, math.pi / 2, 400):  # to the right, from rightwards to downwards
        rear = np.array([-inner + radius * math.sin(turned), -inner + radius * math.cos(turned)])
        middle = rear + 0.5 * wheelbase * np.array([math.cos(turned), -math.sin(turned)])
        bodies.append(
            shapely.affinity.translate(
                shapely.affinity.rotate(rectangle(length, width), -turned, (0, 0), True), *middle
            )
        )
    swept = shapely.union_all(bodies)
    assert swept.intersection(walls(needed + 1e-3)).area < 1e-5
    assert swept.intersection(walls(needed - 5e-3)).area > 1e-5


@pytest.mark.parametrize(("length", "width"), [(0.532, 0.265), (0.6, 0.1), (0.3, 0.29)])
def test_a_rectangle_turns_where_it_says_and_at_some_angle_not_in_less(length: float, width: float) -> None:
    needed = turned_corner(length, width)

    def fits(corridor: float, angle: float) -> bool:
        """Anywhere: outer corners against both outer walls is the best place."""
        body = shapely.affinity.rotate(rectangle(length, width), -angle, (0, 0), True)
        body = shapely.affinity.translate(body, corridor - body.bounds[2], corridor - body.bounds[3])
        return body.intersection(walls(corridor)).area < 1e-9

    angles = np.linspace(0.0, math.pi / 2, 91)
    assert all(fits(needed + 1e-4, angle) for angle in angles)
    assert not all(fits(needed - 2e-3, angle) for angle in angles)


FORWARDS = {"dynamics": "dynamic", "steering_offset": 0.0}


def car(**changes: float) -> dict:
    return {"vehicle": {"base": "knightriders", **changes}}


@pytest.mark.parametrize(
    ("world", "keywords", "words"),
    [
        ({"kind": "circuit", "corridor": 0.55}, FORWARDS, ["corridor=0.55", "0.573 m", "only forwards", "22 degrees"]),
        ({"kind": "ell", "width": 0.55}, car(length=1.1), ["world.width=0.55", "0.576 m", "shunting"]),
        ({"kind": "slalom", "gap": 0.5}, car(width=0.5), ["world.gap=0.5", "0.5 m wide"]),
        ({"kind": "random-circuits", "narrowest": 0.55}, FORWARDS, ["world.narrowest=0.55"]),
    ],
)
def test_worlds_that_no_car_drives_are_refused_with_the_reason(world: dict, keywords: dict, words: list[str]) -> None:
    with pytest.raises(ValueError) as caught:
        gym.make(CIRCUIT, world=world, **keywords)
    message = str(caught.value)
    assert "\n" not in message and all(word in message for word in words), message


def test_narrow_ones_that_it_can_drive_are_not() -> None:
    gym.make(CIRCUIT, world={"kind": "circuit", "corridor": 0.55})
    gym.make(CIRCUIT, world={"kind": "circuit", "corridor": 0.6}, dynamics="dynamic", steering_offset=0.0)
