"""Vehicle classes: values and standard deviations for the numbers that a vehicle file does not have."""

from fifthwheel.vehicle.classes.completion import complete
from fifthwheel.vehicle.classes.table import CLASSES, VehicleClass

__all__ = ["CLASSES", "VehicleClass", "complete"]
