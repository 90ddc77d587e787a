"""What sensors make of the truth."""

from lanekeep_env.sensing.faults import SENSOR_SETS, Sensor, sensors_from

__all__ = ["SENSOR_SETS", "Sensor", "sensors_from"]
