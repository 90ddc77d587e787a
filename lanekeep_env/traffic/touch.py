"""Whether two bodies touch."""

from __future__ import annotations

from lanekeep_env import layout as at
from lanekeep_env.compile import inline_as_written
from lanekeep_env.traffic.follow import LENGTH, WIDTH


@inline_as_written
def touches(j, half_length, half_width, cars):
    """Return whether car 0, of another size, and car j of the traffic overlap: no axis of either parts them."""
    x, y = cars[at.T_X, j] - cars[at.T_X, 0], cars[at.T_Y, j] - cars[at.T_Y, 0]
    cosine, sine = cars[at.T_COSINE, 0], cars[at.T_SINE, 0]
    other_cosine, other_sine = cars[at.T_COSINE, j], cars[at.T_SINE, j]
    along, across = abs(cosine * other_cosine + sine * other_sine), abs(cosine * other_sine - sine * other_cosine)
    return (
        abs(x * cosine + y * sine) <= half_length + LENGTH / 2 * along + WIDTH / 2 * across
        and abs(y * cosine - x * sine) <= half_width + LENGTH / 2 * across + WIDTH / 2 * along
        and abs(x * other_cosine + y * other_sine) <= LENGTH / 2 + half_length * along + half_width * across
        and abs(y * other_cosine - x * other_sine) <= WIDTH / 2 + half_length * across + half_width * along
    )
