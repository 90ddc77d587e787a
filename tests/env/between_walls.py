"""A car between walls for the tests of what it does there: environments, poses, the body, closed forms of them."""

import math

import gymnasium as gym
import numpy as np
import shapely
from shapely.affinity import rotate, translate

import lanekeep_env  # noqa: F401

WALL, CIRCUIT = "lanekeep/WallFollow-v0", "lanekeep/Circuit-v0"
STEP, LIMIT, WHEELBASE = 0.045, math.radians(22.0), 0.35
WIDE = {"kind": "circuit", "length": 80.0, "width": 80.0, "corridor": 20.0}
OVAL = {"kind": "circuit", "length": 10.0, "width": 7.0, "corridor": 2.0}
LENGTH, WIDTH = 0.532, 0.265
SQUARE_ON = {"lateral_error": 0.0, "heading_error": 0.0, "start_index": 0}


def make(name=WALL, **keywords):
    return gym.make(name, **{"steering_offset": 0.0, "world": WIDE, **keywords})


def many(cars, name=WALL, **keywords):
    return gym.make_vec(name, cars, "vector_entry_point", **{"steering_offset": 0.0, **keywords})


def column(env, name):
    return [channel.name for channel in env.unwrapped.channels].index(name)


def pose(env, car=0):
    """x, y (m), heading (rad) of the centre of gravity."""
    found = env.unwrapped._core.pose(car)
    return np.array([found.x, found.y, found.heading])


def body(x, y, heading):
    """The car's body; the middle of the knightriders' is its centre of gravity."""
    outline = shapely.box(-LENGTH / 2, -WIDTH / 2, LENGTH / 2, WIDTH / 2)
    return translate(rotate(outline, heading, origin=(0, 0), use_radians=True), x, y)


def lines(world):
    return shapely.linestrings(world.segments.reshape(-1, 2, 2))


def on_a_circle(start, speed, steer, seconds, wheelbase=WHEELBASE, to_rear=WHEELBASE / 2):
    """Pose of the centre of gravity: the rear axle turns on the radius wheelbase/tan(steer)."""
    x, y, heading = start
    x, y = x - to_rear * math.cos(heading), y - to_rear * math.sin(heading)
    turn = speed * math.tan(steer) / wheelbase * seconds
    angle, middle = heading + turn, heading + turn / 2
    chord = speed * seconds * float(np.sinc(turn / 2 / math.pi))  # 2 radius sin(turn/2)
    x, y = x + chord * math.cos(middle), y + chord * math.sin(middle)
    return np.array([x + to_rear * math.cos(angle), y + to_rear * math.sin(angle), angle])


def apart(one, other):
    """Largest difference of two poses; headings by their directions."""
    turn = math.remainder(one[2] - other[2], 2 * math.pi)
    return max(abs(one[0] - other[0]), abs(one[1] - other[1]), abs(turn))


def ring(world):
    """The closed centre line as shapely knows it."""
    return shapely.LineString(np.concatenate([world.centre_line, world.centre_line[:1]]))
