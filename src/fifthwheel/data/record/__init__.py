"""A record: named signals in SI on one time base, their timestamps, resampling and sensor noise."""

from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.record.record import Record

__all__ = ["Record", "SensorPrior"]
