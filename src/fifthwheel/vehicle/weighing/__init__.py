"""Masses and CoG positions from static axle loads: of a log, or of the slips of a weighbridge."""

from fifthwheel.vehicle.weighing.axle_load_masses import with_axle_loads

__all__ = ["with_axle_loads"]
