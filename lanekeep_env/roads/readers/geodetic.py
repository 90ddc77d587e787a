"""Latitude and longitude as metres on the plane that touches the ellipsoid in the middle of a line."""

from __future__ import annotations

import numpy as np

from lanekeep_env.roads.road import Floats

# WGS 84.
_AXIS, _FLATTENING = 6378137.0, 1.0 / 298.257223563
_SQUARE = _FLATTENING * (2.0 - _FLATTENING)
#: Farthest that a line may reach from its middle, m: a kilometre there is shortened by 3 cm.
FARTHEST = 50_000.0


def projected(latitude: Floats, longitude: Floats, name: str) -> tuple[Floats, float, str]:
    """Return east and north of the middle, m, (n, 2), how far rounded degrees scatter them, m, and what that assumes.

    Heights are left out. At a distance d from the middle lengths are short by up to d² / 2R², R the earth's radius.

    Raises:
        ValueError: degrees that are none, or a line that is too long for one plane.
    """
    for word, values, most in (("latitude", latitude, 90.0), ("longitude", longitude, 360.0)):
        if np.abs(values).max() > most:
            raise ValueError(
                f"{name}: a {word} of {values[np.argmax(np.abs(values))]:g} deg; allowed are +-{most:g} deg"
            )
    rounding = np.array([_rounding(longitude), _rounding(latitude)])
    # Across 180 degrees a line goes on.
    longitude = np.degrees(np.unwrap(np.radians(longitude)))
    phi, lam = np.radians(latitude), np.radians(longitude)
    phi0, lam0 = 0.5 * (phi.min() + phi.max()), 0.5 * (lam.min() + lam.max())
    x, y, z = (a - b for a, b in zip(_earth(phi, lam), _earth(phi0, lam0), strict=True))
    east = -np.sin(lam0) * x + np.cos(lam0) * y
    north = -np.sin(phi0) * (np.cos(lam0) * x + np.sin(lam0) * y) + np.cos(phi0) * z
    points = np.column_stack([east, north])
    far = float(np.hypot(east, north).max())
    if not far <= FARTHEST:
        raise ValueError(
            f"{name}: the line reaches {far / 1000:.0f} km from its middle; allowed are {FARTHEST / 1000:.0f} km on "
            "one plane: cut it into pieces, or project it yourself and give x, y in m"
        )
    shortened = 1e6 * 0.5 * (far / _AXIS) ** 2
    place = f"{np.degrees(phi0):.4f}, {np.degrees(lam0):.4f}"
    scatter = np.radians(rounding) * _AXIS * [np.cos(phi0), 1.0]
    how = f"latitude, longitude projected around {place} deg (lengths short by up to {shortened:.2g} mm a km)"
    return points, float(np.sqrt(np.mean(scatter**2))), how


def _rounding(degrees: Floats) -> float:
    """Standard deviation of what was cut off behind the last decimal, deg; 0 where more than 9 are given."""
    digits = next((k for k in range(10) if np.abs(np.round(degrees, k) - degrees).max() < 1e-12), None)
    return 0.0 if digits is None else 10.0**-digits / np.sqrt(12.0)


def _earth(phi: Floats, lam: Floats) -> tuple[Floats, Floats, Floats]:
    """Earth-centred coordinates at height 0, m."""
    normal = _AXIS / np.sqrt(1.0 - _SQUARE * np.sin(phi) ** 2)
    return (
        normal * np.cos(phi) * np.cos(lam),
        normal * np.cos(phi) * np.sin(lam),
        normal * (1.0 - _SQUARE) * np.sin(phi),
    )
