"""The products that a student of lane keeping sums: gains that follow the speed, and what it has identified."""

from __future__ import annotations

from collections.abc import Sequence

from lanekeep_agents.identified import IDENTIFIED
from lanekeep_agents.student_record import Product

#: Samples of the preview whose gains change with the car that is identified; all have gains that change with the speed.
_AHEAD = (0, 2, 5, 9, 15)
#: Which pairs of identified quantities change the gains as well: tyres with each other and with the actuator's answer.
_PAIRS = (
    *("front_slip*rear_slip", "front_slip*response_now", "front_slip*response_before", "understeer*understeer"),
    *("little_noise*front_slip", "response_now*response_now", "response_before*response_before"),
    *("response_now*response_before", "front_slip*front_slip", "rear_slip*rear_slip", "little_noise*response_now"),
)


def products(channels: Sequence[str]) -> tuple[Product, ...]:
    """Return the products for an environment with these channels, for two LQ controllers of which the first has slip
    offsets.

    The right sides are what a linear controller weighs: measurements, lateral accelerations of the road ahead, the
    estimates of sideslip, offsets, yaw rate, heading and lateral error, and the controllers' own actions.
    """
    own = ("lateral_error", "heading_error", "yaw_rate", "steering_angle", "steering_command")
    ahead = [name for name in channels if name.startswith("curvature_preview_")]
    estimates = tuple(f"base0.{place}" for place in range(1, 7))
    seen = (*own, "1", *estimates, "base0", "base1")
    road = {name: f"{name}*speed*speed" for name in ahead}
    some = [road[ahead[place]] for place in _AHEAD if place < len(ahead)]
    identified = [f"identified.{name}" for name in IDENTIFIED]
    pairs = ["*".join(f"identified.{name}" for name in pair.split("*")) for pair in _PAIRS]
    changing = (*identified, *(f"{name}*speed" for name in identified), *pairs, "identified.response_now*slowness")
    return (
        Product(("1", "speed", "slowness", "speed*speed"), (*seen, *road.values())),
        Product(changing, (*seen, *some)),
    )
