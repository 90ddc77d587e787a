"""What differs from episode to episode: the car and its actuator, drawn between bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from numbers import Real
from typing import Any

from lanekeep_env.checks import record_from, require, shown

Range = tuple[float, float]

#: Share of the friction that a speed profile uses at the most.
FRICTION_SHARE = 0.8


#: What entries take to have an effect, each in a scenario's words: the car's tyres, tyres that saturate, errors of the
#: centre of gravity, a speed that the environment sets, a lag of the nominal actuator.
TYRES, FRICTION, CENTRE_OF_GRAVITY, SPEED, LAG = "tyres", "friction", "centre of gravity", "speed", "lag"
#: ... no bounds of their own between which the scenario draws the steering's offset.
OFFSET = "offset"


def _factor(of: str, needs: str) -> dict[str, Any]:
    return _entry(f"factor of {of}", "(a factor of the nominal value)", 0.05, 20.0, needs)


def _entry(what: str, unit: str, low: float, high: float, needs: str = "") -> dict[str, Any]:
    return {"what": what, "unit": unit, "limits": {"at_least": low, "at_most": high}, "needs": needs}


@dataclass(frozen=True)
class Randomisation:
    """Bounds (low, high) of what an episode draws uniformly; a single number fixes it.

    Attributes:
        mass: factor of mass and yaw inertia.
        friction: factor of the road's friction (saturating tyre). The speed profile uses 80 % of the
            friction at the most, so every episode can be driven.
        front_cornering_stiffness, rear_cornering_stiffness: factors.
        cg_shift: of the centre of gravity towards the front axle, m.
        speed: factor of the speed profile.
        steering_lag: factor of the actuator's lag.
        steering_delay: transport delay added to the actuator's, s, rounded to the integration step.
        steering_gain: factor of the road wheel's angle over the one asked for.
        steering_offset: of the road wheel, added to the actuator's, rad.

    A policy is built from the nominal car: what is drawn here is what it does not know. What has no effect on a
    scenario's cars is refused, but in a named set it is passed over.
    """

    mass: Range = field(default=(1.0, 1.0), metadata=_factor("mass and yaw inertia", TYRES))
    friction: Range = field(default=(1.0, 1.0), metadata=_factor("the road's friction", FRICTION))
    front_cornering_stiffness: Range = field(default=(1.0, 1.0), metadata=_factor("the front axle's stiffness", TYRES))
    rear_cornering_stiffness: Range = field(default=(1.0, 1.0), metadata=_factor("the rear axle's stiffness", TYRES))
    cg_shift: Range = field(
        default=(0.0, 0.0),
        metadata=_entry("shift of the centre of gravity to the front", "m", -0.5, 0.5, CENTRE_OF_GRAVITY),
    )
    speed: Range = field(default=(1.0, 1.0), metadata=_factor("the speed", SPEED))
    steering_lag: Range = field(default=(1.0, 1.0), metadata=_factor("the actuator's lag", LAG))
    steering_delay: Range = field(default=(0.0, 0.0), metadata=_entry("delay added to the actuator's", "s", 0.0, 2.0))
    steering_gain: Range = field(
        default=(1.0, 1.0), metadata=_factor("the road wheel's angle over the one asked for", "")
    )
    steering_offset: Range = field(
        default=(0.0, 0.0), metadata=_entry("offset of the road wheel", "rad", -0.5, 0.5, OFFSET)
    )

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            low, high = value if isinstance(value, tuple | list) and len(value) == 2 else (value, value)
            name, unit, limits = f"randomisation.{f.name}", f.metadata["unit"], f.metadata["limits"]
            if not isinstance(low, Real) or not isinstance(high, Real):
                raise ValueError(f"{name}={shown(value)} is not allowed: it must be (low, high) or one number {unit}")
            require(name, low, unit, **limits)
            require(name, high, unit, **limits)
            if high < low:
                raise ValueError(
                    f"{name}={shown(value)} is not allowed: the bounds must be (low, high) with low <= high"
                )
            object.__setattr__(self, f.name, (float(low), float(high)))

    def bounds(self) -> list[float]:
        """Low and high of each field, in order."""
        return [bound for f in fields(self) for bound in getattr(self, f.name)]


#: Named sets: what a production car meets, and what a test engineer asks for.
RANDOMISATIONS: dict[str, Randomisation] = {
    "nominal": Randomisation(),
    "mismatch": Randomisation(
        mass=(0.9, 1.2),
        friction=(0.6, 1.0),
        front_cornering_stiffness=(0.8, 1.1),
        rear_cornering_stiffness=(0.8, 1.1),
        cg_shift=(-0.05, 0.05),
        speed=(0.9, 1.0),
        steering_lag=(0.8, 1.5),
        steering_delay=(0.0, 0.03),
    ),
    "stress": Randomisation(
        mass=(0.85, 1.3),
        friction=(0.4, 1.0),
        front_cornering_stiffness=(0.7, 1.2),
        rear_cornering_stiffness=(0.7, 1.2),
        cg_shift=(-0.1, 0.1),
        speed=(0.8, 1.0),
        steering_lag=(0.5, 2.0),
        steering_delay=(0.0, 0.08),
    ),
}


def randomisation_from(value: str | Mapping[str, Any] | Randomisation) -> Randomisation:
    """Read a randomisation: a named set, a mapping of bounds, or a record; ValueError names what is wrong."""
    return record_from(Randomisation, value, "randomisation", RANDOMISATIONS, of="bounds")
