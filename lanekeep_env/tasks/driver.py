"""A driver who steers: anticipation of the road's curvature, correction of what is left, lapses of attention.

After Donges, "A two-level model of driver steering behavior", Human Factors 20 (1978): a guidance level steers for the
curvature ahead, a stabilisation level corrects lateral and course error. The hands follow with a lag; where the driver
wants to be in the lane wanders; a driver who does not look holds the wheel as it is.
"""

from __future__ import annotations

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import larger, like

#: Square of the speed below which errors are corrected as at it, m²/s².
SLOWEST_SQUARED = 25.0


@inline
def wanted_angle(off, course, curvature, v, lateral, against_course, angle, growth):
    """Return the road-wheel angle that an attentive driver wants, rad.

    ``off`` is the distance to the left of where the driver wants to be, m, ``course`` the course error, rad,
    ``curvature`` that of the road ahead, 1/m; the driver's curvature is turned into an angle as the car asks for it,
    ``angle`` + ``growth`` v².
    """
    squared = v * v
    corrected = (lateral * off + against_course * v * course) / larger(squared, like(v, SLOWEST_SQUARED))
    return (angle + growth * squared) * (curvature - corrected)
