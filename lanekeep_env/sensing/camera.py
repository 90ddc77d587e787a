"""A camera that looks at the road's edge: the distance of the body's axis from it at a look-ahead point."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import sin_cos

# Gauss-Legendre nodes and weights on [-1, 1]; over the longest pieces taken below the error is 4e-12 of the way.
_NODES = (-0.906179845938664, -0.5384693101056831, 0.0, 0.5384693101056831, 0.906179845938664)
_WEIGHTS = (0.2369268850561891, 0.4786286704993665, 0.5688888888888889, 0.4786286704993665, 0.2369268850561891)

#: Below this share of forward motion along the edge the camera looks across it: nothing is seen.
LEAST_FORWARD = 0.05
#: Pieces and Newton steps at the most; about five are used.
LARGEST_COUNT = 64


@inline
def _chord(angle, curvature, slope, way):
    """Displacement (m) over ``way`` metres of a clothoid that starts at ``angle``."""
    x = y = 0.0
    for k in range(5):
        u = 0.5 * way * (1.0 + _NODES[k])
        sine, cosine = sin_cos(angle + (curvature + 0.5 * slope * u) * u)
        x += 0.5 * way * _WEIGHTS[k] * cosine
        y += 0.5 * way * _WEIGHTS[k] * sine
    return x, y


@helper
def edge_distance(i, block, counters, road, camera):
    """Return the distance of car i's body axis from the road's edge, m, or NaN where the camera sees none.

    Measured from the look-ahead point, ``CAMERA_REACH`` ahead of the rear axle on the body's axis, along the body's
    lateral axis to the first point of the edge there, positive while the edge is on its own side. The edge is the
    curve parallel to the road at ``CAMERA_OFFSET``. Exact on piecewise linear curvature: the road is followed in body
    axes from the place beside the rear axle, and Newton's method finds where the edge is level with the point.
    Not seen: an edge that turns away before, one outside the field of view, one without marking.
    """
    reach, offset, widest = camera[at.CAMERA_REACH], camera[at.CAMERA_OFFSET], camera[at.CAMERA_WIDEST]
    segment = counters[at.SEGMENT, i]
    u = max(np.float64(block[at.ALONG, i]), 0.0)
    d, angle = np.float64(block[at.LATERAL, i]), -np.float64(block[at.HEADING, i])
    length, kappa0 = np.float64(road[segment, at.R_LENGTH]), np.float64(road[segment, at.R_CURVATURE])
    slope = np.float64(road[segment, at.R_CURVATURE_SLOPE])
    sine, cosine = sin_cos(angle)
    x, y = d * sine, -d * cosine  # the centre line beside the rear axle, in body axes from there
    if x - offset * sine >= reach:
        return np.nan
    for _ in range(LARGEST_COUNT):
        kappa = kappa0 + slope * u
        forward = (1.0 - offset * kappa) * cosine
        if forward < LEAST_FORWARD:
            return np.nan
        way = (reach - (x - offset * sine)) / forward
        if abs(way) < 1e-11 * reach:
            distance = y + offset * cosine
            distance = distance if offset > 0.0 else -distance
            seen = abs(distance) <= widest and camera[at.CAMERA_SIZE + segment] > 0.0
            return distance if seen else np.nan
        way = max(min(way, 0.7 / (abs(kappa) + 1e-9), np.sqrt(0.2 / (abs(slope) + 1e-9))), -u)
        leaves = way >= length - u
        way = length - u if leaves else way
        step_x, step_y = _chord(angle, kappa, slope, way)
        x += step_x
        y += step_y
        angle += (kappa + 0.5 * slope * way) * way
        u += way
        sine, cosine = sin_cos(angle)
        if leaves and x - offset * sine < reach:  # else Newton went too far, and the place is in this segment
            segment = np.int64(road[segment, at.R_NEXT])
            length, kappa0 = np.float64(road[segment, at.R_LENGTH]), np.float64(road[segment, at.R_CURVATURE])
            slope, u = np.float64(road[segment, at.R_CURVATURE_SLOPE]), 0.0
    return np.nan
