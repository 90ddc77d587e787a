"""What sensors make of the truth."""

from lanekeep_env.sensing.faults import MEASURED_CHANNELS, SENSOR_SETS, Sensor, sensors_from

__all__ = ["MEASURED_CHANNELS", "SENSOR_SETS", "Sensor", "sensors_from"]
