"""How near the car's body comes to a point on a planned path, and a target that keeps it away (KnightRiders, 4.3.1).

The report's target is 0.2 m beside the jump point. A body of 0.265 m has 6.8 cm left there, and less on the way, where
it stands across. Here the target is as far aside as the swept body needs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lanekeep_baselines.path_planning import evade, roll
from lanekeep_baselines.policy import Floats

#: Places aside that are tried, m apart, and how many: decisions.
FINER, TRIED = 0.02, 16


@dataclass(frozen=True)
class Body:
    """The body's ends ahead of and behind the rear axle and half its width, and the axle's turning radii, m."""

    front: float
    rear: float
    half_width: float
    radius_left: float | Floats
    radius_right: float | Floats


def clearance(segments: Floats, ahead: ArrayLike, left: ArrayLike, body: Body, every: int = 24) -> Floats:
    """Return the least distance, m, (n,), of the body to a point on its way along the segments (n, k, 2).

    The point is in the frame of the first pose, from the REAR AXLE; negative is inside the body. Each segment is looked
    at at ``every`` + 1 places.
    """
    x, y = (np.asarray(value, dtype=np.float64)[..., None] for value in (ahead, left))
    share = np.linspace(0.0, 1.0, every + 1)
    pose = np.zeros((len(segments), 1, 3))
    least = np.full(len(segments), np.inf)
    for k in range(segments.shape[1]):
        poses = roll(pose, share * segments[:, k, :1], segments[:, k, 1:])
        cosine, sine = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        along = cosine * (x - poses[..., 0]) + sine * (y - poses[..., 1])
        across = np.abs(cosine * (y - poses[..., 1]) - sine * (x - poses[..., 0])) - body.half_width
        along = np.maximum(along - body.front, -body.rear - along)
        outside = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
        distance = np.where(np.maximum(along, across) > 0.0, outside, np.maximum(along, across))
        least = np.minimum(least, distance.min(axis=1))
        pose = poses[:, -1:]
    return least


def aside(ahead: Floats, left: Floats, side: Floats, body: Body, margin: float, reverse: float) -> Floats:
    """Return how far beside a jump point the target has to be, m, (n,), for ``margin`` m between it and the body.

    The point is ``ahead`` of and ``left`` of the nose, m, to be passed on ``side`` (1 left, -1 right), by the path that
    `evade` plans. At least half the width and the margin; where no place will do, the one that leaves the most.
    """
    from_axle = ahead + body.front
    chosen = best = np.full(len(ahead), -np.inf)
    for k in range(TRIED):
        offset = body.half_width + margin + k * FINER
        across = left + side * offset
        segments = evade(from_axle, across, body.radius_left, body.radius_right, reverse)
        # What backs up passes nothing.
        left_over = np.where(segments[:, 0, 0] < 0.0, -1.0, clearance(segments, from_axle, left, body))
        better = (best < margin) & (left_over > best)
        chosen, best = np.where(better, offset, chosen), np.where(better, left_over, best)
        if (best >= margin).all():
            break
    return chosen
