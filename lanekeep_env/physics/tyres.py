"""Lateral axle forces from slip angles (rad, positive slip pushes left), in N."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import arctan, like, sin_cos

#: Shape factor C of the magic formula for lateral force; 1.3 to 1.6 in the literature (W08 digest: 1.5).
MAGIC_FORMULA_SHAPE = 1.5
#: C tan(pi / 2C): a linear tyre's force over the peak, at the slip where the magic formula has its peak.
LINEAR_AT_PEAK = MAGIC_FORMULA_SHAPE * math.tan(math.pi / (2.0 * MAGIC_FORMULA_SHAPE))


@inline
def linear(slip, stiffness):
    """F = C_alpha alpha: the linear tyre of Yin 2010."""
    return stiffness * slip


@inline
def magic_formula(slip, stiffness, peak):
    """F = D sin(C atan(B alpha)), D = mu F_z, B = C_alpha / (C D): saturates at ``peak`` N.

    Pacejka and Bakker, "The magic formula tyre model", Vehicle System Dynamics 21 (1992), curvature
    factor E = 0; its slope at zero slip is the cornering stiffness, so it meets `linear` there.
    """
    shape = like(slip, MAGIC_FORMULA_SHAPE)
    sine, _ = sin_cos(shape * arctan(stiffness * slip / (shape * peak)))
    return peak * sine


def slip_at(force: Any, stiffness: Any, peak: Any) -> Any:
    """The slip, rad, up to that of the peak, at which `magic_formula` gives ``force``: its inverse, for arrays."""
    return MAGIC_FORMULA_SHAPE * peak / stiffness * np.tan(np.arcsin(force / peak) / MAGIC_FORMULA_SHAPE)
