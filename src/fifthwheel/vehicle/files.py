"""Vehicle files as functions; see `Vehicle.load` and `toml_format`."""

from fifthwheel.vehicle.toml_format import FILE_KEYS, read_quantity
from fifthwheel.vehicle.vehicle import Vehicle

load, loads, save, dump = Vehicle.load, Vehicle.loads, Vehicle.save, Vehicle.to_toml

__all__ = ["FILE_KEYS", "dump", "load", "loads", "read_quantity", "save"]
