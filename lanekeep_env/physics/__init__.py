"""The equations, in the order the signal travels: steering, tyres, single track, integration.

Everything here is a pure scalar function of floats (no arrays, no randomness, no globals), so that a
loop over cars becomes SIMD code; `integrate.py` holds that loop.
"""

from lanekeep_env.physics.parameters import SteeringActuator, VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES, vehicle_from

__all__ = ["VEHICLES", "SteeringActuator", "VehicleParameters", "vehicle_from"]
