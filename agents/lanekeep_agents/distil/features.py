"""The products that a student on a road sums: gains that follow the speed, and what it has identified."""

from __future__ import annotations

from collections.abc import Sequence

from lanekeep_agents.identified import IDENTIFIED
from lanekeep_agents.student_record import Product

#: Samples of the preview whose gains change with the car that is identified; all have gains that change with the speed.
_AHEAD = (0, 2, 5, 9, 15)
#: Estimates of an LQ controller with slip offsets; the first number it remembers is none.
_ESTIMATES = 6
#: Which pairs of identified quantities change the gains as well: tyres with each other and with the actuator's answer.
_PAIRS = (
    *("front_slip*rear_slip", "front_slip*response_now", "front_slip*response_before", "understeer*understeer"),
    *("little_noise*front_slip", "response_now*response_now", "response_before*response_before"),
    *("response_now*response_before", "front_slip*front_slip", "rear_slip*rear_slip", "little_noise*response_now"),
)


def products(channels: Sequence[str], memory: int = 8, bases: int = 2, slips: bool = True) -> tuple[Product, ...]:
    """Return the products for an environment with these channels.

    The right sides are what a linear controller weighs: measurements, lateral accelerations of the road ahead (its
    curvatures where the car rolls without slip), the controllers' own actions and, where the first one is an LQ one
    with slip offsets, its estimates of sideslip, offsets, yaw rate, heading and lateral error.

    Args:
        channels: of the environment.
        memory: numbers that the first controller remembers.
        bases: how many controllers there are.
        slips: whether the car has tyres that slip.
    """
    own = ("lateral_error", "heading_error", "yaw_rate", "steering_angle", "steering_command")
    ahead = [name for name in channels if name.startswith("curvature_preview_")]
    estimates = [f"base0.{place}" for place in range(1, min(memory, _ESTIMATES + 1))]
    seen = (*own, "1", *estimates, *(f"base{number}" for number in range(bases)))
    road = {name: f"{name}*speed*speed" if slips else name for name in ahead}
    some = [road[ahead[place]] for place in _AHEAD if place < len(ahead)]
    identified = [f"identified.{name}" for name in IDENTIFIED]
    pairs = ["*".join(f"identified.{name}" for name in pair.split("*")) for pair in _PAIRS]
    changing = (*identified, *(f"{name}*speed" for name in identified), *pairs, "identified.response_now*slowness")
    return (
        Product(("1", "speed", "slowness", "speed*speed"), (*seen, *road.values())),
        Product(changing, (*seen, *some)),
    )
