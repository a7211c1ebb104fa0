"""A record: named signals in SI on one time base, their timestamps, resampling and sensor noise."""

from fifthwheel.channels.sensors import SensorPrior
from fifthwheel.record.record import Record

__all__ = ["Record", "SensorPrior"]
